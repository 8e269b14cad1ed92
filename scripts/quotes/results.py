# SPDX-License-Identifier: Apache-2.0
"""The results of comparisons, as the pages quote them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from scripts.result_files import RESULTS, ROOT, SCHEMA, commit, load, write
from slam.errors import LogFormatError

__all__ = [
    "RESULTS", "ROOT", "SCHEMA", "Comparison", "Interval", "Pair", "commit", "load", "write",
]  # fmt: skip

Cell = list[Any]


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
