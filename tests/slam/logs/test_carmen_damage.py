# SPDX-License-Identifier: Apache-2.0
"""Damaged CARMEN logs: a ``LogFormatError`` that names the file, never a plausible stream."""

import gzip
import lzma
import os

import pytest

from slam.errors import LogFormatError
from slam.logs import open_log, read_carmen

pytestmark = pytest.mark.fuzz


def refuse(path, match):
    with pytest.raises(LogFormatError, match=match) as caught:
        read_carmen(path)
    assert str(path) in str(caught.value)
    with pytest.raises(LogFormatError):
        open_log(path)


def test_files_that_are_none(tmp_path):
    refuse(tmp_path / "missing.log", "no such file")
    refuse(tmp_path, "not a regular file")
    os.mkfifo(tmp_path / "pipe.log")
    refuse(tmp_path / "pipe.log", "not a regular file")
    for name in ("empty.log", "empty.log.xz", "empty.log.gz"):
        (tmp_path / name).touch()
        refuse(tmp_path / name, "is empty")


@pytest.mark.parametrize("name", ["a.log", "a.log.gz", "a.log.xz", "noise"])
def test_binary_garbage(tmp_path, name):
    garbage = bytes((i * 197 + i // 7) % 256 for i in range(5000))
    (tmp_path / name).write_bytes(garbage)
    refuse(tmp_path / name, "not a text file|corrupt")


@pytest.mark.parametrize(("suffix", "compress"), [(".gz", gzip.compress), (".xz", lzma.compress)])
def test_compressed_files_cut_or_damaged(tmp_path, carmen_text, suffix, compress):
    path = tmp_path / f"a.log{suffix}"
    whole = compress(carmen_text.plain_log().encode())
    path.write_bytes(whole)
    assert read_carmen(path).length == 8
    path.write_bytes(whole[:-20])
    refuse(path, "corrupt or truncated")
    middle = len(whole) // 2
    path.write_bytes(whole[:middle] + bytes(40) + whole[middle + 40 :])
    with pytest.raises(LogFormatError):
        read_carmen(path)


def test_a_last_line_cut_anywhere_is_left_out_and_refused_by_a_strict_reader(
    tmp_path, carmen_text, caplog
):
    text = carmen_text.plain_log(3)
    path = tmp_path / "cut.log"
    for end in range(len(text) - 60, len(text)):
        path.write_text(text[:end])
        caplog.clear()
        stream = read_carmen(path)
        torn = not text[:end].endswith("\n")
        assert stream.length == 3
        assert stream.metadata.extra["torn_last_line"] == torn
        assert len(caplog.records) == torn
        if torn:
            with pytest.raises(LogFormatError, match=r"truncated \(refused by --strict"):
                read_carmen(path, strict=True)
    path.write_text("FLASER 181 1.0 2.0")
    refuse(path, "truncated")


CHANGES = [
    ("FLASER 181", "FLASER 180", "has 191 words, got 192"),
    ("FLASER 181", "FLASER 99999999999", "expected 1 to 20000 beams"),
    ("FLASER 181", "FLASER -3", "expected 1 to 20000 beams"),
    ("FLASER 181", "FLASER many", "many"),
    (" 2.07 ", " -2.07 ", "range 1 must be 0 to"),
    ("ODOM 0.", "ODOM nan 0.", "ODOM has 10 words"),
    ("# comment", "%PDF-1.4", "expected a message name"),
    (" 2.07 ", " 2.07\x00 ", "not a text file"),
]


@pytest.mark.parametrize(("old", "new", "match"), CHANGES)
def test_a_damaged_word_is_named_with_its_line(tmp_path, carmen_text, old, new, match):
    text = carmen_text.plain_log()
    assert old in text
    path = tmp_path / "a.log"
    path.write_text(text.replace(old, new, 1))
    refuse(path, rf"a\.log:\d+: .*{match}")


def test_changes_of_the_scanner(tmp_path, carmen_text):
    pose = [0.0, 0.0, 0.0]
    path = tmp_path / "a.log"
    path.write_text(
        carmen_text.flaser(0, 0.0, pose, pose) + carmen_text.flaser(1, 1.0, pose, pose, n=361)
    )
    refuse(path, r"a\.log:2: the number of beams changes from 181 to 361")
    line = carmen_text.robotlaser(0, 0.0, pose, pose)
    path.write_text(line + line.replace(" 8.0 ", " 9.0 ").replace("0.000000 host", "1.0 host"))
    refuse(path, r"a\.log:2: the scanner changes")
    path.write_text(line.replace(" 8.0 ", " -8.0 "))
    refuse(path, "maximum range > 0")
    path.write_text(line.replace(" 0 0 0 0 0 ", " "))
    refuse(path, "does not fit its own counts")


def test_logs_without_what_is_needed(tmp_path, carmen_text):
    path = tmp_path / "a.log"
    path.write_text("# only a comment\n\n")
    refuse(path, "no scan found")
    path.write_text(carmen_text.odom(0.0, [0.0, 0.0, 0.0]))
    refuse(path, "no scan found")
    path.write_text(carmen_text.rawlaser(0, 1.0))
    refuse(path, "no ODOM")
    path.write_text(carmen_text.rawlaser(0, 1.0) + carmen_text.odom(5.0, [0.0, 0.0, 0.0]))
    refuse(path, "no scan lies within")


def test_an_endless_line_is_refused(tmp_path):
    path = tmp_path / "a.log"
    path.write_bytes(b"FLASER " + b"1 " * 600_000 + b"\n")
    refuse(path, "longer than")


def test_other_text_has_no_known_format(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("Dear reader\nthis is no log\n")
    with pytest.raises(LogFormatError, match=r"of no known format; known: .*CARMEN"):
        open_log(path)
