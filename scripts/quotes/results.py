# SPDX-License-Identifier: Apache-2.0
"""The results of comparisons, and their numbers and verdicts as the pages say them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from scripts.metrics.table import METRICS
from scripts.result_files import load
from slam.errors import LogFormatError

VERDICTS = {1: "better", -1: "**beaten**", 0: "no clear difference"}


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

    @property
    def won(self) -> str:
        """``9 of 10``."""
        return f"{self.wins} of {self.wins + self.ties + self.losses}"


@dataclass(frozen=True)
class Comparison:
    """``comparison.json``."""

    path: Path

    @cached_property
    def data(self) -> dict[str, Any]:
        """All of it."""
        return load(self.path)

    def levels(self, scene: str, slam: str, metric: str) -> list[Interval | None]:
        """One for each level, None where there is none."""
        return [cell and _interval(cell) for cell in self._row("levels", scene, slam, metric)]

    def pairs(self, scene: str, rival: str, metric: str) -> list[Pair | None]:
        """Shunting less ``rival``, one for each level, None where there is none."""
        return [cell and _pair(cell) for cell in self._row("paired", scene, rival, metric)]

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


def _interval(cell: list[Any]) -> Interval:
    return Interval(*map(_number, cell))


def _pair(cell: list[Any]) -> Pair:
    value, low, high = map(_number, cell[:3])
    wins, ties, losses = map(int, cell[3:])
    return Pair(value, low, high, wins, ties, losses)


def shown(value: float, places: int) -> str:
    """``2.3``, ``−0.7``; ∞ for what never ends, – for no number."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    digits = f"{abs(value):.{places}f}"
    if float(digits) == 0.0:
        return digits
    return ("−" if value < 0.0 else "") + digits


def interval(of: Interval | None, metric: str, places: int) -> str:
    """``1.8 [1.5, 2.0]`` in the metric's handy unit; – where there is none."""
    if of is None:
        return "–"
    factor = METRICS[metric].factor
    value, low, high = (shown(factor * n, places) for n in (of.value, of.low, of.high))
    return f"{value} [{low}, {high}]"


def verdict(pair: Pair | None, metric: str) -> int:
    """1 where shunting is better, -1 where it is beaten, 0 where the interval holds zero."""
    if pair is None or not (pair.low > 0.0 or pair.high < 0.0):
        return 0
    return 1 if (pair.high < 0.0) == bool(METRICS[metric].less_is_better) else -1


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def made(data: dict[str, Any], seeds: Sequence[int]) -> str:
    """Commit, seeds and machine of a results file."""
    ran = f"seeds {seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else f"seed {seeds[0]}"
    machine = data["machine"]
    return (
        f"commit {data['commit'][:7]}, {ran}, {machine['processor']} with {machine['cores']} "
        f"cores, Python {machine['python']}"
    )
