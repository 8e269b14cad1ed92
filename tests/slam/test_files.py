# SPDX-License-Identifier: Apache-2.0
"""Files appear whole or not at all."""

from __future__ import annotations

import pytest

from slam.errors import MobiliaError, OutputError
from slam.files import replacing, write_bytes, write_text


def tree(folder):
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))


def write_half(path, error):
    with replacing(path) as temporary:
        temporary.write_bytes(b"half")
        raise error


def test_a_file_is_replaced_when_the_block_succeeds(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "old")
    with replacing(path) as temporary:
        assert temporary.suffix == ".txt"
        assert temporary.parent == path.parent
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert tree(tmp_path) == ["a.txt"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit, GeneratorExit])
def test_nothing_is_left_when_it_does_not(tmp_path, error):
    path = tmp_path / "deep" / "down" / "a.bin"
    with pytest.raises(error):
        write_half(path, error)
    assert tree(tmp_path) == []
    write_bytes(path, b"whole")
    with pytest.raises(error):
        write_half(path, error)
    assert path.read_bytes() == b"whole"
    assert tree(tmp_path) == ["deep", "deep/down", "deep/down/a.bin"]


def test_folders_that_others_use_by_now_stay(tmp_path):
    def write(path):
        with replacing(path) as temporary:
            (temporary.parent / "b").touch()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        write(tmp_path / "new" / "a")
    assert tree(tmp_path) == ["new", "new/b"]


def test_places_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "file" / "a", tmp_path / "folder", tmp_path / ("x" * 300)):
        with pytest.raises(OutputError, match="cannot write") as caught:
            write_text(path, "text")
        assert str(path) in str(caught.value)
        assert isinstance(caught.value, MobiliaError)
    with pytest.raises(OutputError, match="not a file name"):
        write_text(tmp_path.__class__("."), "text")
    assert tree(tmp_path) == ["file", "folder"]


def test_a_disk_error_inside_is_named_once(tmp_path):
    with (
        pytest.raises(OutputError) as caught,
        replacing(tmp_path / "a"),
        replacing(tmp_path / "b"),
    ):
        raise OSError(28, "No space left on device")
    assert str(caught.value) == f"cannot write {tmp_path / 'b'}: No space left on device"
    assert tree(tmp_path) == []
