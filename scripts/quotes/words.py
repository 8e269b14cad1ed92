# SPDX-License-Identifier: Apache-2.0
"""Numbers and verdicts as pages say them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from scripts.metrics.row import Metric
from scripts.metrics.table import METRICS
from scripts.quotes.results import Interval, Pair
from scripts.report.words import levels_text

VERDICTS = {1: "better", -1: "**beaten**", 0: "no clear difference"}


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
    less: Metric = METRICS[metric]
    return 1 if (pair.high < 0.0) == bool(less.less_is_better) else -1


def verdicts(pairs: Sequence[Pair | None], levels: Sequence[float], metric: str) -> str:
    """In words: at which levels shunting is better, at which it is beaten, at which neither."""
    said = []
    for side, words in VERDICTS.items():
        at = [
            level
            for level, pair in zip(levels, pairs, strict=True)
            if pair is not None and verdict(pair, metric) == side
        ]
        if at:
            said.append(f"{words} {levels_text(at, list(levels))}")
    return ", ".join(said)


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
