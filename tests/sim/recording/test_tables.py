# SPDX-License-Identifier: Apache-2.0
"""``things.csv`` and ``rearranged.csv``: what is written is read, all else is refused by name."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from sim.actors.rearranging import FAR_M, Rearrangement
from sim.recording.days import THING_COLUMNS, THINGS, Thing, read_things
from sim.recording.tables import (
    COLUMNS,
    REARRANGED,
    Rearranged,
    pose_words,
    read_rearranged,
    table,
    write_rearranged,
)
from slam.errors import LogFormatError

BOUNDS = (0.0, 0.0, 8.0, 6.0)
THING = ["0", "morning", "chair0", "chair_swivel", "1.5", "2.5", "-0.1"]
CHANGE = ["2.0", "chair0", "moved", "1.5", "2.5", "-0.1", "3.5", "0.5", "1.0"]
BAD_WORDS = ("", "chair\n0", "a\r\nb", "nul\0", "\x1b[2J", "x" * 201)
BAD_NUMBERS = (
    "nan", "inf", "-inf", "1e308", "x", "1,5", "",
    "1_0", " 1.5 ", "+1", ".5", "1.", "0x1", "\u0663", "0" * 41,
)  # fmt: skip


def _things(folder: Path, *rows: list[str]) -> list[Thing]:
    (folder / THINGS).write_text(table(THING_COLUMNS, rows), newline="")
    return read_things(folder)


def _changes(folder: Path, *rows: list[str]) -> list[Rearranged]:
    (folder / REARRANGED).write_text(table(COLUMNS, rows), newline="")
    return read_rearranged(folder)


def _but(row: list[str], column: int, word: str) -> list[str]:
    return [*row[:column], word, *row[column + 1 :]]


def test_what_is_written_is_read(tmp_path: Path):
    here, there, out = (1.5, 2.5, -0.1), (3.5, 0.5, 1.0), (8.0 + FAR_M, 0.0, 0.0)
    events = [
        Rearrangement(time_s=2.0, name="chair0", change="moved", before=here, after=there),
        Rearrangement(time_s=2.0, name="bin, the old", change="removed", before=there, after=out),
        Rearrangement(time_s=4.0, name="chair1", change="brought in", before=out, after=here),
    ]
    write_rearranged(tmp_path / REARRANGED, events, BOUNDS)
    found = read_rearranged(tmp_path)
    assert [e.name for e in found] == ["chair0", "bin, the old", "chair1"]
    assert [(e.before, e.after) for e in found] == [(here, there), (there, None), (None, here)]
    (thing, gone) = _things(tmp_path, THING, [*_but(THING, 2, "bin0")[:4], *pose_words(None)])
    assert (thing.session, thing.pose, gone.pose) == (0, here, None)


def test_a_wrong_field_of_things_is_named_with_its_line(tmp_path: Path):
    wrong = [(2, w, "name") for w in BAD_WORDS] + [(3, w, "kind") for w in BAD_WORDS]
    wrong += [(column, w, "_m|_rad") for column in (4, 5, 6) for w in BAD_NUMBERS]
    wrong += [(0, w, "session") for w in ("-1", "50", "1.0", "", "9" * 5000, "²")]
    wrong += [(1, w, "time_of_day") for w in ("lunch", "", "x" * 300)]
    for column, word, named in wrong:
        with pytest.raises(LogFormatError, match=rf"things\.csv:\d+: .*({named}) must be") as told:
            _things(tmp_path, THING, _but(_but(THING, 2, "chair1"), column, word))
        assert len(str(told.value)) < len(str(tmp_path)) + 300
        assert str(told.value).isprintable()
    with pytest.raises(LogFormatError, match=r"things\.csv:3: session 0 has 'chair0' twice"):
        _things(tmp_path, THING, THING)


def test_a_wrong_field_of_what_was_rearranged_is_named_with_its_line(tmp_path: Path):
    wrong = [(1, w, "name") for w in BAD_WORDS] + [(2, w, "change") for w in ("", "eaten")]
    wrong += [(column, w, "_m|_rad") for column in range(3, 9) for w in BAD_NUMBERS]
    wrong += [(0, w, "time_s") for w in ("-1", *BAD_NUMBERS)]
    for column, word, named in wrong:
        with pytest.raises(LogFormatError, match=rf"rearranged\.csv:\d+: .*({named}) must be"):
            _changes(tmp_path, CHANGE, _but(CHANGE, column, word))
    with pytest.raises(LogFormatError, match="time_s must not go back from 2, got 1"):
        _changes(tmp_path, CHANGE, _but(CHANGE, 0, "1.0"))
    for word in ("removed", "brought in"):
        with pytest.raises(LogFormatError, match=f"'{word}' does not go with these poses"):
            _changes(tmp_path, _but(CHANGE, 2, word))
    with pytest.raises(LogFormatError, match="'moved' does not go with these poses"):
        _changes(tmp_path, [*CHANGE[:6], "", "", ""])


@pytest.mark.parametrize(("name", "read"), [(THINGS, read_things), (REARRANGED, read_rearranged)])
def test_what_is_no_such_table_is_refused(name, read, tmp_path: Path):
    file = tmp_path / name
    columns = ",".join(THING_COLUMNS if name == THINGS else COLUMNS)
    for text in (b"", b"a,b\n", f"{columns},more\n".encode(), columns[::-1].encode(), b"\xff\xfe"):
        file.write_bytes(text)
        with pytest.raises(LogFormatError, match=name):
            read(tmp_path)
    for rest in ("1,2\n", "\n", '"open', "x" * 200_000 + "\n", '"a"b,c\n'):
        file.write_text(f"{columns}\n{rest}")
        with pytest.raises(LogFormatError, match=rf"{name}:2: (expected|no table)"):
            read(tmp_path)
    file.unlink()
    with pytest.raises(LogFormatError, match=name):
        read(tmp_path)


@pytest.mark.parametrize(("name", "read"), [(THINGS, read_things), (REARRANGED, read_rearranged)])
def test_a_thousand_million_rows_are_refused_before_they_are_read(name, read, tmp_path: Path):
    (tmp_path / name).touch()
    os.truncate(tmp_path / name, 40 * 10**9)  # sparse: it takes no room
    with pytest.raises(LogFormatError, match=r"40000000000 bytes; at most 67108864 are allowed"):
        read(tmp_path)
