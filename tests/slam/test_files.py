# SPDX-License-Identifier: Apache-2.0
"""Files appear whole or not at all, and cells of a CSV are no formulas."""

import errno
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slam import files
from slam.errors import MobiliaError, OutputError
from slam.files import (
    cell_of,
    exchange,
    is_part,
    locked,
    reason,
    replacing,
    word_of,
    write_bytes,
    write_text,
)


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


def test_what_a_killed_run_left_is_removed_and_what_is_being_written_is_not(tmp_path):
    path = tmp_path / "a.txt"
    for name in (".a.17.part.txt", ".a.txt.17.part", ".ab.17.part.txt", ".a.x.17.part.txt"):
        (tmp_path / name).write_text("left")
    (tmp_path / ".a.18.part.txt").write_text("being written")
    with locked(tmp_path / ".a.18.part.txt"):
        write_text(path, "whole")
    assert tree(tmp_path) == [".a.18.part.txt", ".a.x.17.part.txt", ".ab.17.part.txt", "a.txt"]
    write_text(path, "whole")
    assert ".a.18.part.txt" not in tree(tmp_path)


def test_two_things_are_swapped_or_neither(tmp_path):
    for name in ("a", "b"):
        write_text(tmp_path / name / "of", name)
    if not exchange(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this system cannot swap names")
    assert (tmp_path / "a" / "of").read_text() == "b"
    assert (tmp_path / "b" / "of").read_text() == "a"
    with pytest.raises(OSError, match="No such file"):
        exchange(tmp_path / "a", tmp_path / "missing")


@pytest.mark.parametrize("place", [0, 1])
def test_a_disk_that_is_full_only_when_synced(tmp_path, monkeypatch, place):
    """Of a file: nothing is left. Of the folder after the rename: told, and the file is whole."""
    write_text(tmp_path / "a", "old")
    fsync, calls = os.fsync, []

    def full(number):
        calls.append(number)
        if len(calls) == place + 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(number)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match=r"cannot write .*/a: No space left on device"):
        write_text(tmp_path / "a", "new")
    assert tree(tmp_path) == ["a"]
    assert (tmp_path / "a").read_text() == ("old", "new")[place]


def test_a_full_disk_is_called_one_whatever_the_writer_said(tmp_path, monkeypatch):
    broken = BrokenPipeError(errno.EPIPE, "Broken pipe")
    wrapped = OSError("encoder error -2 when writing image file")
    wrapped.__cause__ = OSError(errno.ENOSPC, "No space left on device")
    assert reason(wrapped, tmp_path) == "No space left on device"
    assert reason(broken, tmp_path) == "Broken pipe"
    assert reason(OSError("words\nmore"), tmp_path) == "words"
    monkeypatch.setattr(files, "_free_bytes", lambda folder: 0)
    assert reason(broken, tmp_path) == "No space left on device"
    assert reason(PermissionError(errno.EACCES, "Permission denied"), tmp_path) != reason(
        broken, tmp_path
    )


def test_names_of_what_is_unfinished():
    assert all(map(is_part, (".a.1.part", ".a.host.1.part", ".a.1.part.npz")))
    assert not any(map(is_part, ("a.part", ".a", ".apart", "a.1.part.npz", ".tables.ready")))


@pytest.mark.parametrize("word", ["=1+1", "+cmd", "-cmd", "@SUM(A1)", "\tx", "\rx", "=", "'=x"])
def test_what_a_spreadsheet_would_compute_is_text(word):
    assert cell_of(word) == f"'{word}"
    assert word_of(cell_of(word)) == word


@pytest.mark.parametrize("word", ["-0.5", "+1", "-1e-05", "-inf", "", "nan", "a=b", "it's", "'tis"])
def test_numbers_and_other_words_stay_as_they_are(word):
    assert cell_of(word) == word_of(word) == word


@given(st.text(st.sampled_from("'=+-@\t\r1.e a") | st.characters(), max_size=8))
def test_every_word_comes_back(word):
    cell = cell_of(word)
    assert word_of(cell) == word
    if cell.startswith(tuple("=+-@\t\r")):
        float(cell)
