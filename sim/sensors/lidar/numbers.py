# SPDX-License-Identifier: Apache-2.0
"""Every number of a registered scanner with its unit, meaning and source: ``mobilia config``.

Units follow from a field's name, meanings are the words of its docstring, sources those of the
model's data sheet (``sim.sensors.lidar.sheet``).
"""

import inspect
import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

from sim.sensors.lidar.registry import model_of, names, scanner_of
from sim.sensors.lidar.scanner import Scanner, Spot
from sim.sensors.lidar.sheet import NOT_STATED, Stated, sheet_of
from slam.settings import About, Row

UNITS = {"deg": "deg", "m": "m", "s": "s", "hz": "Hz", "aperture": "m", "divergence": "rad"}
# Field of ``Scanner`` -> which row of a data sheet states it.
STATED_AS = {
    "first_deg": "field_of_view_deg", "clockwise": "direction", "noise": "noise_m",
    "systematic": "systematic_m", "error_codes": "no_return", "spot": "spot_width_m",
}  # fmt: skip
SETTING = "a setting: NAME=VALUE in brackets"
_FIELD = re.compile(r"(\w+(?:, \w+)*) {2,}(\S.*)")


def is_scanner(what: str) -> bool:
    """Whether that is a registered scanner, with or without settings and errors."""
    return _bare(what) in names()


def _bare(what: str) -> str:
    """``utm30lx`` of ``utm30lx(...):noise``."""
    return re.split(r"[(:]", what)[0].strip()


def numbers_of(what: str, source: str) -> list[Row]:
    """All numbers of a scanner by its name in writing; of one that needs settings first, these.

    source  of a config that is no plain ``Scanner``: its docstring names the pages

    Raises what ``scanner_of`` raises.
    """
    model = model_of(_bare(what))
    settings = inspect.signature(model).parameters.values()
    if "(" not in what and any(setting.default is setting.empty for setting in settings):
        meanings = meanings_of(model)
        return [
            _row(s.name, "needed" if s.default is s.empty else s.default, meanings[s.name], SETTING)
            for s in settings
        ]
    config, sheet = scanner_of(what), sheet_of(_bare(what))
    of_sheet = isinstance(config, Scanner)
    return [
        _row(path, value, words, _source(sheet, path, value) if of_sheet else source)
        for path, value, words in _walk(config, "")
    ]


def _walk(config: Any, prefix: str) -> Iterator[tuple[str, Any, str]]:
    """(path, value, meaning) of each field of a dataclass and of those in it."""
    meanings = meanings_of(type(config))
    for field in fields(config):
        path, value = prefix + field.name, getattr(config, field.name)
        parts = value if isinstance(value, tuple) else ()
        if is_dataclass(value):
            yield from _walk(value, f"{path}.")
        elif parts and is_dataclass(parts[0]):
            for k, part in enumerate(parts):
                yield from _walk(part, f"{path}.{k}.")
        elif field.name != "name":
            value = f"{len(value)} values" if isinstance(value, tuple) else value
            yield path, value, meanings.get(field.name, "")


def meanings_of(owner: Any) -> dict[str, str]:
    """The docstring's words on each name: ``name  words``, continued on lines indented further."""
    found: dict[str, str] = {}
    said: list[str] = []
    for line in (inspect.getdoc(owner) or "").replace("``", "").splitlines():
        match = _FIELD.fullmatch(line)
        if match:
            said = match[1].split(", ")
            found |= dict.fromkeys(said, match[2])
        elif line.startswith("  ") and said:
            found |= {name: f"{found[name]} {line.strip()}" for name in said}
        else:
            said = []
    return found


def _row(path: str, value: Any, meaning: str, source: str) -> Row:
    name = path.rpartition(".")[2]
    plain = "word" if isinstance(value, bool | str) or value is None else "1"
    unit = UNITS.get(name) or UNITS.get(name.rpartition("_")[2], plain)
    return Row(path, value, About(unit=unit, meaning=meaning, source=source))


def _source(sheet: tuple[Stated, ...], path: str, value: Any) -> str:
    """Where a number of a ``Scanner`` is stated, in the words of its data sheet."""
    if not sheet:
        return "set by the model"
    first, _, rest = path.partition(".")
    stated = [row for row in sheet if row.what == STATED_AS.get(first, first) and row.source]
    if not stated:
        default = getattr(Spot if first == "spot" else Scanner, rest or first, None)
        return NOT_STATED if value in (default, "0 values", "1 values") else "inferred"
    k = int(rest.partition(".")[0]) if rest[:1].isdigit() else 0
    return stated[min(k, len(stated) - 1)].source
