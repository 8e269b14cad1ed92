# SPDX-License-Identifier: Apache-2.0
"""Sums of many cases, and the tables of the page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from scripts.experiments.measured import table
from scripts.integrity.counting import (
    ALERT_M,
    bin_quantile,
    most_of_time,
    most_of_trials,
    pooled,
)
from slam.evaluation.statistics import quantile

Row = Mapping[str, Any]
ALL = "all"
CM, PERCENT, S_PER_HOUR = 100.0, 100.0, 3600.0
INTEGRITY = (
    "way", "losses", "hazardous", "of losses, %", "scans, %", "denied, %", "misleading, %",
    "unavailable, %", "wrong places", "hours", "moments an hour",
)  # fmt: skip
RECOVERY = (
    "way", "to recover", "not", "median, s", "p90, s", "worst, s", "SE(2), cm", "p95, cm",
    "unaligned, cm", "silent, %",
)  # fmt: skip
TIMES = ("way", "scans", "p50, ms", "p99, ms", "p99.9, ms", "longest, ms")


def summary(cases: Sequence[Row]) -> dict[str, Any]:
    """Of the files of cases of one way and SLAM, or of several ways.

    hazardous     losses with at least one hazardous scan; ``most`` their share at most (95 %)
    denied        share of the scans that are hazardous, and beyond 3 sigma of the covariance too
    moments       stretches of hazardous scans, of drives and losses; an hour, and at most (95 %)
    recover_s     of outages of drives and of losses after an event: never is infinite
    """
    drives = [case["drive"] for case in cases if "scans" in case["drive"]]
    losses = [loss for case in cases for loss in case["losses"]]
    events = [loss for loss in losses if loss["event"]]
    seen = [*drives, *events]
    scans = sum(one["scans"] for one in seen)
    hours = sum(one["seconds"] for one in seen) / S_PER_HOUR
    hazardous = sum(loss["hazardous"] > 0 for loss in losses)
    moments = sum(one["stretches"] for one in seen)
    spent = [one for case in cases for one in (case["drive"], *case["losses"]) if "ms" in one]
    return {
        "cases": len(cases),
        "failed": sum(bool(case["failed"]) for case in cases),
        "losses": len(losses),
        "hazardous": hazardous,
        "most": most_of_trials(hazardous, len(losses)),
        "scans": scans,
        "hazardous_scans": _share(sum(one["hazardous"] for one in seen), scans),
        "denied": _share(sum(one["denied"] for one in seen), scans),
        "misleading": _share(sum(one["misleading"] for one in seen), scans),
        "unavailable": _share(sum(one["unavailable"] for one in seen), scans),
        "wrong_places": sum(one["wrong_places"] for one in seen),
        "hours": hours,
        "moments": moments,
        "moments_per_hour": moments / hours if hours > 0.0 else math.nan,
        "moments_per_hour_most": most_of_time(moments, hours),
        **_recoveries(drives, events),
        **_errors(drives),
        **_times(spent),
    }


def _share(count: int, scans: int) -> float:
    return count / scans if scans else math.nan


def _recoveries(drives: Sequence[Row], events: Sequence[Row]) -> dict[str, Any]:
    took = [float(s) for drive in drives for s in drive["outages"]]
    took += [float(loss["recovered_s"]) for loss in events]
    return {
        "to_recover": len(took),
        "not_recovered": sum(math.isinf(s) for s in took),
        "recover_s": quantile(took, 0.5),
        "recover_p90_s": quantile(took, 0.9),
        "recover_worst_s": max(took, default=math.nan),
    }


def _errors(drives: Sequence[Row]) -> dict[str, Any]:
    scans = sum(drive["scans"] for drive in drives)
    silent = sum((drive["silent"] or 0.0) * drive["scans"] for drive in drives)
    return {
        "se2": quantile([drive["se2"] for drive in drives], 0.5),
        "se2_p95": quantile([drive["se2"] for drive in drives], 0.95),
        "ate": quantile([drive["ate"] for drive in drives], 0.5),
        "silent": silent / scans if scans else math.nan,
    }


def _times(spent: Sequence[Row]) -> dict[str, Any]:
    bins = pooled([one["ms"] for one in spent])
    return {
        "timed": sum(bins.values()),
        "p50_ms": bin_quantile(bins, 0.5),
        "p99_ms": bin_quantile(bins, 0.99),
        "p999_ms": bin_quantile(bins, 0.999),
        "longest_ms": max((one["max_ms"] for one in spent), default=math.nan),
    }


def told(value: float, digits: int = 2, times: float = 1.0) -> str:
    """A number of a cell; a dash for none, "never" for what lasts."""
    if math.isnan(value):
        return "–"
    return "never" if math.isinf(value) else f"{times * value:.{digits}f}"


def markdown(rows: Mapping[tuple[str, str], Row]) -> str:
    """Three tables for each SLAM: integrity, recovery and errors, times. Keys: SLAM and way."""
    parts = []
    for slam in dict.fromkeys(slam for slam, _ in rows):
        own = {way: row for (name, way), row in rows.items() if name == slam}
        parts += [
            f"`{slam}`, hazardous beyond {ALERT_M:g} m:",
            table(INTEGRITY, [_integrity(way, row) for way, row in own.items()]),
            table(RECOVERY, [_recovery(way, row) for way, row in own.items()]),
            table(TIMES, [_time(way, row) for way, row in own.items()]),
        ]
    return "\n\n".join(parts)


def _integrity(way: str, row: Row) -> list[str]:
    share = row["hazardous"] / row["losses"] if row["losses"] else math.nan
    return [
        way,
        str(row["losses"]),
        str(row["hazardous"]),
        f"{told(share, 2, PERCENT)} (≤ {told(row['most'], 2, PERCENT)})",
        told(row["hazardous_scans"], 3, PERCENT),
        told(row["denied"], 3, PERCENT),
        told(row["misleading"], 3, PERCENT),
        told(row["unavailable"], 2, PERCENT),
        str(row["wrong_places"]),
        told(row["hours"], 2),
        f"{told(row['moments_per_hour'])} (≤ {told(row['moments_per_hour_most'])})",
    ]


def _recovery(way: str, row: Row) -> list[str]:
    return [
        way,
        str(row["to_recover"]),
        str(row["not_recovered"]),
        *(told(row[key], 2) for key in ("recover_s", "recover_p90_s", "recover_worst_s")),
        *(told(row[key], 2, CM) for key in ("se2", "se2_p95", "ate")),
        told(row["silent"], 3, PERCENT),
    ]


def _time(way: str, row: Row) -> list[str]:
    keys = ("p50_ms", "p99_ms", "p999_ms", "longest_ms")
    return [way, str(row["timed"]), *(told(row[key], 1) for key in keys)]
