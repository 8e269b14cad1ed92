# SPDX-License-Identifier: Apache-2.0
"""Archives of arrays: the same arrays, or one error that names the file."""

import io
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from slam.archives import read_arrays, write_arrays
from slam.errors import LogFormatError


def _arrays() -> dict[str, NDArray[Any]]:
    rng = np.random.default_rng(0)
    return {
        "poses": rng.normal(size=(40, 3)),
        "columns": np.asfortranarray(rng.normal(size=(7, 5))),
        "names": np.array(["alice", "bob"]),
        "header": np.array('{"format": "some"}'),
        "none": np.zeros((0, 3)),
        "count": np.array(3),
        "moving": rng.random(60) < 0.5,
    }


def _same(one: dict[str, NDArray[Any]], other: dict[str, NDArray[Any]]) -> bool:
    return list(one) == list(other) and all(
        a.dtype == other[name].dtype and np.array_equal(a, other[name]) for name, a in one.items()
    )


def test_what_is_written_is_read_and_is_the_same_bytes_again(tmp_path: Path):
    paths = tmp_path / "one.npz", tmp_path / "other.npz"
    for path in paths:
        with path.open("wb") as opened:
            write_arrays(opened, _arrays())
    assert _same(read_arrays(paths[0]), _arrays())
    assert paths[0].read_bytes() == paths[1].read_bytes()
    np.savez_compressed(tmp_path / "numpy.npz", **_arrays())
    assert len(paths[0].read_bytes()) < 1.2 * (tmp_path / "numpy.npz").stat().st_size


@pytest.fixture(params=["savez", "savez_compressed"])
def file(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    path = tmp_path / "some.npz"
    getattr(np, request.param)(path, **_arrays())
    return path


def test_arrays_come_back(file: Path) -> None:
    assert _same(read_arrays(file), _arrays())
    assert list(read_arrays(file, ["names", "count"])) == ["names", "count"]


def test_a_damaged_file_is_refused_or_holds_the_same(file: Path) -> None:
    whole, rng = file.read_bytes(), np.random.default_rng(1)
    refused = 0
    for _ in range(150):
        at = int(rng.integers(len(whole)))
        for damaged in (
            whole[:at] + bytes([whole[at] ^ (1 << int(rng.integers(8)))]) + whole[at + 1 :],
            whole[:at] + whole[at + 1 :],
            whole[:at],
        ):
            file.write_bytes(damaged)
            refused += _refused_or_same(file)
    assert refused > 300


def _refused_or_same(file: Path) -> bool:
    try:
        found = read_arrays(file)
    except LogFormatError as error:
        return str(file) in str(error)
    assert _same(found, _arrays())
    return False


def test_a_missing_file_a_folder_and_a_pipe_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "none.npz", tmp_path, tmp_path / "pipe"):
        with pytest.raises(LogFormatError, match="cannot be read"):
            read_arrays(path)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.npz"
    np.savez_compressed(path, zeros=np.zeros(50_000_000, np.uint8), small=np.ones(3))
    assert path.stat().st_size < 100_000
    with pytest.raises(LogFormatError, match="unpacks to"):
        read_arrays(path, max_bytes=10_000_000)
    assert list(read_arrays(path, ["small"], max_bytes=10_000)) == ["small"]


def _member(path: Path, header: str, data: bytes = b"") -> Path:
    text = header.ljust(117) + "\n"
    magic = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", magic + text.encode("latin1") + data)
    return path


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000, 8, 8)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1, -1)}",
        "{'descr': '|V0', 'fortran_order': False, 'shape': (1000000000000,)}",
        "{'descr': '|O', 'fortran_order': False, 'shape': (1,)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (True,)}",
        "{'descr': '<zz', 'fortran_order': False, 'shape': (1,)}",
        "{'descr': '<f8'",
        "((((((((((((",
    ],
)
def test_what_a_header_claims_must_fit_the_file(tmp_path: Path, header: str) -> None:
    with pytest.raises(LogFormatError, match=r"a\.npz"):
        read_arrays(_member(tmp_path / "a.npz", header, bytes(7)))


def test_pickles_and_foreign_members_are_refused(tmp_path: Path) -> None:
    pickled, foreign = tmp_path / "pickled.npz", tmp_path / "foreign.npz"
    np.savez(pickled, evil=np.array([{}], dtype=object))
    with pytest.raises(LogFormatError, match="holds objects"):
        read_arrays(pickled)
    data = io.BytesIO()
    np.save(data, np.ones(3))
    for names, method in ((["a.txt"], 0), (["a.npy"], zipfile.ZIP_LZMA)):
        with zipfile.ZipFile(foreign, "w", method) as archive:
            for name in names:
                archive.writestr(name, data.getvalue())
        with pytest.raises(LogFormatError, match=r"foreign\.npz"):
            read_arrays(foreign)
