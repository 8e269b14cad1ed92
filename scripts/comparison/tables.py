# SPDX-License-Identifier: Apache-2.0
"""From the rows of runs to ``levels.csv`` and ``paired.csv``."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, TypeVar

from scripts.comparison.schema import FAILED
from scripts.metrics.table import JUDGED, MEDIANS, METRICS, SHARES
from slam.evaluation.statistics import median_interval, paired, quantile, share_interval

Row = dict[str, Any]
R = TypeVar("R", bound=Mapping[str, Any])


def number(row: Row, metric: str) -> float | None:
    """A cell as a number: infinite for the error of a SLAM that failed, None where it is empty."""
    value = row.get(metric)
    if value is None and row["outcome"] in FAILED and METRICS[metric].worst_if_failed:
        return math.inf
    return None if value is None or math.isnan(value) else float(value)


def levels(rows: Sequence[Row]) -> list[Row]:
    """Median, interval and quartiles of each metric; of losses the share."""
    out = []
    for (scene, dynamism, slam), group in grouped(rows, ("scene", "dynamism", "slam")).items():
        for metric in (*SHARES, *MEDIANS):
            values = [v for v in (number(row, metric) for row in group) if v is not None]
            if values:
                head = {"scene": scene, "dynamism": dynamism, "slam": slam, "metric": metric}
                out.append(head | _summary(values, metric in SHARES))
    return out


def _summary(values: list[float], is_share: bool) -> Row:
    if is_share:
        return share_of(round(sum(values)), len(values))
    return median_of(values) | {"q25": quantile(values, 0.25), "q75": quantile(values, 0.75)}


def share_of(hits: int, n: int) -> Row:
    """So many of ``n`` in the columns of a summary, with Wilson's 95 % interval."""
    low, high = share_interval(hits, n)
    return {"statistic": "share", "n": n, "value": hits / n, "low": low, "high": high}


def median_of(values: Sequence[float]) -> Row:
    """The median in the columns of a summary, with its 95 % bootstrap interval."""
    low, high = median_interval(values)
    value = quantile(values, 0.5)
    return {"statistic": "median", "n": len(values), "value": value, "low": low, "high": high}


def pairs(rows: Sequence[Row]) -> list[Row]:
    """Every two SLAMs on the runs where both have the number."""
    out = []
    slams = list(dict.fromkeys(row["slam"] for row in rows))
    for (scene, dynamism), group in grouped(rows, ("scene", "dynamism")).items():
        for metric in JUDGED:
            for slam_a, slam_b in combinations(slams, 2):
                a, b = (by_seed(group, slam, metric) for slam in (slam_a, slam_b))
                seeds = sorted(a.keys() & b.keys())
                if not seeds:
                    continue
                both = ([a[seed] for seed in seeds], [b[seed] for seed in seeds])
                head = {"scene": scene, "dynamism": dynamism, "metric": metric}
                head |= {"slam_a": slam_a, "slam_b": slam_b}
                out.append(head | paired(*both, less_is_better=METRICS[metric].better == "less"))
    return out


def by_seed(rows: Sequence[Row], slam: str, metric: str) -> dict[int, float]:
    """The runs of one SLAM that have the number."""
    pairs = ((row["seed"], number(row, metric)) for row in rows if row["slam"] == slam)
    return {seed: value for seed, value in pairs if value is not None}


def grouped(rows: Iterable[R], keys: Sequence[str]) -> dict[tuple[Any, ...], list[R]]:
    """Rows by what they have in these columns, in the order in which that comes."""
    groups: dict[tuple[Any, ...], list[R]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return groups
