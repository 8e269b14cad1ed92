# SPDX-License-Identifier: Apache-2.0
"""The results files that the pages quote: small, sorted, one line for each thing measured."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from slam.errors import InvalidValueError, LogFormatError
from slam.files import write_text

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "docs" / "results"
SCHEMA = 1
CODE = ("slam", "sim", "scenes", "scripts")
Cell = list[Any]


def commit(*code: str) -> str:
    """The last commit that changed ``code`` (paths; default all of it).

    Raises ``InvalidValueError`` where the code here is another than that.
    """
    paths = code or CODE
    changed = _git("status", "--porcelain", "--untracked-files=no", "--", *paths)
    if changed:
        raise InvalidValueError(
            f"commit these first, so that results can name the code:\n{changed}"
        )
    return _git("log", "-1", "--format=%H", "--", *paths)


def _git(*words: str) -> str:
    done = subprocess.run(
        ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False, timeout=60
    )
    if done.returncode != 0:
        raise InvalidValueError(f"git {words[0]} must work in {ROOT}: {done.stderr.strip()}")
    return done.stdout.rstrip()


def write(path: Path, head: Mapping[str, Any], tables: Mapping[str, Mapping[str, Any]]) -> None:
    """JSON with a line for each entry of ``head`` and of each table."""
    entries = [f"{json.dumps(key)}: {_plain(value)}" for key, value in head.items()]
    for name, table in tables.items():
        lines = ",\n".join(f"  {json.dumps(key)}: {_plain(row)}" for key, row in table.items())
        entries.append(f"{json.dumps(name)}: {{\n{lines}\n }}")
    write_text(path, "{\n " + ",\n ".join(entries) + "\n}\n")


def _plain(value: Any) -> str:
    return json.dumps(_rounded(value), allow_nan=False)


def _rounded(value: Any) -> Any:
    """Six digits; infinity as "inf", which JSON has no number for, NaN as null."""
    if isinstance(value, Mapping):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(one) for one in value]
    if not isinstance(value, float):
        return value
    if math.isnan(value):
        return None
    return float(f"{value:.6g}") if math.isfinite(value) else str(value)


def load(path: Path) -> dict[str, Any]:
    """A results file; ``LogFormatError`` for what is none of this schema."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise LogFormatError(path, f"no results file: {error}") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise LogFormatError(path, f"no results file of schema {SCHEMA}")
    return data


@dataclass(frozen=True)
class Interval:
    """A median or share with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Pair(Interval):
    """Median of shunting's number less the rival's, run by run, and how many runs each won."""

    wins: int
    ties: int
    losses: int


@dataclass(frozen=True)
class Comparison:
    """``comparison.json`` or ``comparison_noise.json``."""

    path: Path

    @cached_property
    def data(self) -> dict[str, Any]:
        """All of it."""
        return load(self.path)

    @property
    def scenes(self) -> list[str]:
        """In the order of the command."""
        return list(self.data["scenes"])

    @property
    def slams(self) -> list[str]:
        """In the order of the command."""
        return list(self.data["slams"])

    @property
    def dynamisms(self) -> list[float]:
        """The levels, ascending."""
        return list(self.data["dynamism"])

    def levels(self, scene: str, slam: str, metric: str) -> list[Interval | None]:
        """One for each level, None where there is none."""
        cells = self._row("levels", scene, slam, metric)
        return [None if cell is None else Interval(*map(_number, cell)) for cell in cells]

    def pairs(self, scene: str, rival: str, metric: str) -> list[Pair | None]:
        """Shunting less ``rival``, one for each level, None where there is none."""
        cells = self._row("paired", scene, rival, metric)
        return [None if cell is None else _pair(cell) for cell in cells]

    def over_levels(self, scene: str, rival: str, metric: str) -> Pair:
        """The same of one number for each seed: its median difference over the levels."""
        return _pair(self._row("over_levels", scene, rival, metric))

    def rank_correlation(self, scene: str, slam: str, metric: str) -> float:
        """Spearman's, of dynamism with the medians; NaN where these are all the same."""
        return _number(self._row("rank_correlation", scene, slam, metric))

    def _row(self, table: str, *key: str) -> Any:
        try:
            return self.data[table][" ".join(key)]
        except KeyError as error:
            raise LogFormatError(self.path, f"lacks {error} in {table}") from error


def _number(cell: Any) -> float:
    return math.nan if cell is None else float(cell)


def _pair(cell: Cell) -> Pair:
    value, low, high = map(_number, cell[:3])
    wins, ties, losses = map(int, cell[3:])
    return Pair(value, low, high, wins, ties, losses)
