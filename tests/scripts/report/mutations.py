# SPDX-License-Identifier: Apache-2.0
"""A comparison's folder, harmed at random: one thing in one file, other than a flipped byte."""

from __future__ import annotations

import csv
import io
import json
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

ODD_VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 3, 1.5, 1e308, 10**400, float("nan"), float("inf"), "", "text", "nan",
    "\x1b[31m\n", "x" * 3000, [], {}, [[]], {"a": 1}, ["a", "a"], [1], [float("nan")], "dynamism",
)  # fmt: skip
ODD_CELLS = (
    "", "nan", "inf", "-inf", "-1", "0", "1", "3.0", "1.5", "7", "1e99", "1e308", "1e999", "text",
    "=1+1", "'", "\x1b[31m", "a\nb", '"', "1_0", "٣", "9" * 400, "9" * 5000, "x" * 140_000,
    "ekf", "room", "lost", "hung", "share", "median", "[]", "{}", "None", "\u202e",
)  # fmt: skip
ODD_NUMBERS = (
    0.0, -1.0, 1e-300, 1e-3, 1e3, 1e9, 1e12, 1e30, 1e300, np.nan, np.inf, -np.inf, 255, 7,
)  # fmt: skip


_TABLE_WAYS = (
    "row gone", "row twice", "column gone", "column twice", "cell gone", "cell more", "empty",
    "bytes", "none but the head",
)  # fmt: skip


def mutate(folder: Path, draw: random.Random) -> tuple[Path, str]:
    """Harm one of its files; which, and how."""
    found = [path for path in folder.rglob("*") if path.suffix in _WAYS]
    path = draw.choice(sorted(path for path in found if path.stat().st_size > 1))
    said = _WAYS[path.suffix](path, draw)
    return path, f"{path.relative_to(folder)}: {said}"


def _recipe(path: Path, draw: random.Random) -> str:
    words = json.loads(path.read_text())
    places = _places(words)
    inner, key = draw.choice(places)
    way = draw.choice(("other", "other", "other", "gone", "twice", "deep"))
    said = f"{way} at {key}"
    if way == "gone":
        del inner[key]
    elif way == "twice" and isinstance(inner[key], list):
        inner[key] = [*inner[key], *inner[key]]
    elif way == "deep":
        for _ in range(draw.choice((3, 900))):
            inner[key] = [inner[key]]
    else:
        inner[key] = draw.choice(ODD_VALUES)
        said += f", now {inner[key]!r:.40}"
    path.write_text(json.dumps(words))
    return said


def _places(words: Any) -> list[tuple[Any, Any]]:
    """(mapping or list, key) of everything in it."""
    keys = list(words) if isinstance(words, dict) else range(len(words))
    found = [(words, key) for key in keys]
    for key in keys:
        if isinstance(words[key], dict | list):
            found += _places(words[key])
    return found


def _table(path: Path, draw: random.Random) -> str:
    lines = list(csv.reader(io.StringIO(path.read_text(), newline="")))
    k, c = draw.randrange(len(lines)), draw.randrange(len(lines[0]))
    way = draw.choice(("cell",) * 12 + _TABLE_WAYS)
    said = f"{way} at {k}, {lines[0][c]}"
    if way == "cell":
        lines[k][c] = draw.choice(ODD_CELLS)
        said += f", now {lines[k][c]!r:.40}"
    elif way == "row gone":
        del lines[k]
    elif way == "row twice":
        lines.insert(k, lines[k])
    elif way == "column gone":
        lines = [line[:c] + line[c + 1 :] for line in lines]
    elif way == "column twice":
        lines = [[*line, line[c]] for line in lines]
    elif way == "cell gone":
        del lines[k][c]
    elif way == "cell more":
        lines[k].append("1")
    elif way == "none but the head":
        del lines[1:]
    if way in ("empty", "bytes"):
        path.write_bytes(b"" if way == "empty" else bytes(draw.randrange(256) for _ in range(99)))
        return said
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(lines)
    path.write_text(text.getvalue())
    return said


def _run(path: Path, draw: random.Random) -> str:
    with np.load(path) as file:
        arrays = dict(file)
    name = draw.choice(sorted(arrays))
    way = draw.choice(list(_ARRAY_WAYS))
    if way == "gone":
        del arrays[name]
    elif way == "claims much":
        np.savez_compressed(path, **arrays)
        return f"{way} at {name}" + _claimed(path, name, draw)
    elif way == "a bomb":  # 64 MB of nothing, which take 64 kB
        arrays[name] = np.broadcast_to(np.uint8(0), (1 << 14, 1 << 12))
    else:
        arrays[name] = _ARRAY_WAYS[way](arrays[name], draw)
    (np.savez if way != "a bomb" else np.savez_compressed)(path, **arrays)
    return f"{way} at {name}" + (f", now {arrays[name]!r:.60}" if way == "number" else "")


def _claimed(path: Path, name: str, draw: random.Random) -> str:
    """Rewrite the header of an array: a shape that nothing backs."""
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    shape = draw.choice(((1 << 40,), (1 << 20, 1 << 20), (-1,), (0,), (2, 0, 1 << 60)))
    head = io.BytesIO()
    about = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(head, about)
    members[f"{name}.npy"] = head.getvalue() + b"\0" * 64
    with zipfile.ZipFile(path, "w") as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return f" of {shape}"


def _number(array: Any, draw: random.Random) -> Any:
    """One entry is another; all of them now and then."""
    if array.dtype.kind not in "iufb" or array.size == 0:
        return np.zeros_like(array)
    other = array.astype(np.float64) if array.dtype.kind == "f" else array.copy()
    with np.errstate(all="ignore"):
        odd = np.float64(draw.choice(ODD_NUMBERS)).astype(other.dtype)
    if draw.random() < 0.3:
        other[...] = odd
    else:
        other.reshape(-1)[draw.randrange(array.size)] = odd
    return other


_ARRAY_WAYS: dict[str, Callable[[Any, random.Random], Any]] = {
    "gone": lambda a, _: a,
    "claims much": lambda a, _: a,
    "a bomb": lambda a, _: a,
    "number": _number,
    "number again": _number,
    "number once more": _number,
    "another number": _number,
    "turned": lambda a, _: a.T,
    "shorter": lambda a, _: a[:-1] if a.ndim else a,
    "longer": lambda a, _: np.concatenate([a, a]) if a.ndim else a[None],
    "of nothing": lambda a, _: np.array([]),
    "flat": lambda a, _: a.ravel(),
    "deeper": lambda a, _: a[None],
    "floats": lambda a, _: np.zeros(a.shape),
    "words": lambda a, _: np.full(a.shape, "a\x1b"),
    "shorts": lambda a, _: np.ones(a.shape, np.int8),
    "turned bytes": lambda a, _: a.astype(a.dtype.newbyteorder()),
    "complex": lambda a, _: np.ones(a.shape, np.complex128),
    "records": lambda a, _: np.zeros(a.shape, [("x", "f8")]),
    "dates": lambda a, _: np.zeros(a.shape, "M8[ns]"),
}
_WAYS = {".json": _recipe, ".csv": _table, ".npz": _run}
