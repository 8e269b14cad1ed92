# SPDX-License-Identifier: Apache-2.0
"""Damaged and hostile variants of small files."""

import gzip
import lzma
import re
from io import BytesIO

import numpy as np

Rng = np.random.Generator
ODD = (
    "nan", "inf", "-inf", "1e19", "-1e30", "1e308", "-1e308", "1e-300", "5e-324", "0", "-0", "-1",
    "1e4", "10001", "1e999", "4294967296", "-2147483649", "9" * 400, "0x10", "1_0", "", "x", "1e9",
)  # fmt: skip
HOSTILE = (
    '<replicate count="1000000000"><geom size="1"/></replicate>', '<include file="/dev/zero"/>',
    '<geom type="mesh" mesh="m"/>', "<body>" * 3000, '<composite type="grid" count="999 999 1"/>',
    '<!DOCTYPE m [<!ENTITY a "a">]>', '<geom name="wall:north" class="wall" size="1 1 1"/>',
    "[[event]]\nat_s = 1\n", "walls = " + "[" * 3000, "robot = '../x.toml'\n", "plan = '/x.xml'\n",
    '"a": ' + "[" * 3000, "{" * 3000, "\0\0\0\0", "\ufeff", "\u2028", "\x1b[2J", "a" * 100_000,
)  # fmt: skip


def damaged(data: bytes, rng: Rng) -> bytes:
    """One to six random injuries: bits, numbers, lost and doubled stretches, a cut."""
    out = bytearray(data)
    for _ in range(int(rng.integers(1, 7) if rng.random() < 0.5 else 1)):
        if not out:
            break
        at = int(rng.integers(len(out)))
        length = int(rng.integers(1, 1 + min(64, len(out) - at)))
        match int(rng.integers(7)):
            case 0:
                out[at] ^= 1 << int(rng.integers(8))
            case 1:
                out[at : at + length] = rng.bytes(length)
            case 2:
                del out[at : at + length]
            case 3:
                out[at:at] = out[at : at + length]
            case 4:
                out[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\0\0\0\0", b"\0\0\xc0\x7f"])
            case 5:
                out[at : at + length] = bytes(rng.choice(list(b'0123456789.-eE \n"{}[]'), length))
            case _:
                if rng.random() < 0.2:
                    del out[at:]
    return bytes(out)


def reworded(data: bytes, rng: Rng) -> bytes:
    """A text with other or odd numbers or words, a hostile line, or lines lost or doubled."""
    text = data.decode("utf-8", "replace")
    words = list(re.finditer(r"-?[0-9]+(\.[0-9]*)?([eE][-+]?[0-9]+)?", text))
    words += list(re.finditer(r"[A-Za-z_]+", text)) if rng.random() < 0.2 or not words else []
    few = min(len(words), int(rng.integers(1, 4)))
    chosen = [words[k] for k in rng.choice(len(words), few, replace=False)]
    for word in sorted(chosen, key=lambda found: -found.start()):
        new = ODD[int(rng.integers(len(ODD)))]
        if word[0][-1].isdigit() and rng.random() < 0.5:
            new = f"{float(word[0]) * rng.choice([-1.0, 0.1, 0.9, 1.1, 3.0, 10.0, 1000.0]):.6g}"
        text = text[: word.start()] + new + text[word.end() :]
    lines = text.splitlines(keepends=True)
    at, to = (int(rng.integers(len(lines) + 1)) for _ in range(2)) if lines else (0, 0)
    kind = rng.random()
    if kind < 0.15:
        lines[at:at] = [HOSTILE[int(rng.integers(len(HOSTILE)))]]
    elif kind < 0.25:
        lines[at:at] = lines[to : to + 3]
    elif kind < 0.3:
        del lines[at : at + 2]
    return "".join(lines).encode("utf-8", "replace")


def repacked(data: bytes, rng: Rng) -> bytes:
    """The numbers of one array of an archive are odd ones, or its shape is."""
    with np.load(BytesIO(data)) as file:
        arrays = dict(file)
    name = sorted(arrays)[int(rng.integers(len(arrays)))]
    array = arrays[name].copy()
    if array.dtype.kind == "U":
        arrays[name] = np.array(reworded(str(array).encode(), rng).decode())
    elif array.size and rng.random() < 0.8:
        odd = rng.choice([np.nan, np.inf, -1.0, 1e308, 2.0**31, 2.0**62, 5e-324, 255.0])
        with np.errstate(all="ignore"):
            array.flat[rng.integers(array.size, size=3)] = np.array([odd]).astype(array.dtype)[0]
        arrays[name] = array
    else:
        arrays[name] = (
            array[..., None] if rng.random() < 0.5 else array.ravel()[:0].astype(np.float16)
        )
    new = BytesIO()
    np.savez_compressed(new, **arrays)
    return new.getvalue()


def mutant(name: str, data: bytes, rng: Rng) -> bytes:
    """One variant of a file."""
    if name.endswith(".npz") and rng.random() < 0.7:
        return repacked(data, rng)
    for suffix, module in ((".gz", gzip), (".xz", lzma)):
        if name.endswith(suffix) and rng.random() < 0.8:
            return module.compress(mutant("a.log", module.decompress(data), rng))
    is_text = not re.search(r"\.(pgm|png|mcap|db3|bag|rawlog|npz|state|gz|xz)$", name)
    return (reworded if is_text and rng.random() < 0.7 else damaged)(data, rng)
