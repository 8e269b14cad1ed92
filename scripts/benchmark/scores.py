# SPDX-License-Identifier: Apache-2.0
"""From the rows of runs to those of the leaderboard: one for each track and SLAM."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.stats import spearmanr

from scripts.benchmark.tracks import Track
from scripts.comparison.schema import FAILED
from scripts.comparison.tables import number
from slam.evaluation.lost import LOST_M
from slam.evaluation.statistics import (
    bootstrap_draws,
    central_interval,
    drawn_medians,
    quantile,
)
from slam.frames import Float

Row = dict[str, Any]
FAIR_M = 0.1 * LOST_M  # of median error, up to which the oracle may be off at any level
FAIR_LOST = 0.1  # of its runs at any level, up to which the oracle may be lost: 0 of 6, 2 of 20
TRACKING, SILENT = "error_tracking_m", "silent_share"
DRIFT, ATE = "rpe_m_per_m", "ate_unaligned_m"
LEAST_DRIFT = 1e-6  # m/m, below which logarithms are of nothing measured
COSTS = ("ms_per_scan_p50", "ms_per_scan_p999", "peak_memory_mb")
COLUMNS = (
    "track", "counts", "slam", "seeds", "runs", "lost_runs", "failed_runs",
    "lost_from", "lost_from_low", "lost_from_high", "lost_at_top",
    TRACKING, f"{TRACKING}_low", f"{TRACKING}_high", f"{TRACKING}_runs", SILENT,
    "spearman", "spearman_ate", *COSTS,
)  # fmt: skip


def lost_from(levels: Sequence[float], shares: Sequence[float] | Float) -> float:
    """The level from which at least half of the runs are lost; infinite where it never comes.

    Shares (n,) are made to rise with the level by isotonic regression, and read off linearly
    between the levels. No shape is assumed. A logistic curve would have none to fit where nobody is
    lost at one level and everybody at the next, which is usual.
    """
    rising, k = _crossing(shares)
    if k is None:
        return math.inf
    if k == 0:
        return float(levels[0])
    part = (0.5 - float(rising[k - 1])) / float(rising[k] - rising[k - 1])
    return float(levels[k - 1] + part * (levels[k] - levels[k - 1]))


def _crossing(shares: Sequence[float] | Float) -> tuple[Float, int | None]:
    """The shares (n,) made to rise, and the first of at least one half."""
    rising: Float = isotonic_regression(np.asarray(shares, dtype=np.float64)).x
    above = np.flatnonzero(rising >= 0.5 - 1e-12)
    return rising, int(above[0]) if len(above) else None


def lost_from_interval(levels: Sequence[float], lost: Float) -> tuple[float, float]:
    """95 % interval of ``lost_from``: percentile bootstrap over the seeds; NaN of fewer than two.

    It holds at least the two levels between which ``lost_from`` is read off: nothing was run there.

    lost  (seeds, levels) of 0 and 1: a seed is the same room at every level, so it is drawn whole
    """
    n = len(lost)
    if n < 2:
        return math.nan, math.nan
    draws = bootstrap_draws(n)
    shares, times = np.unique(lost[draws].mean(axis=1), axis=0, return_counts=True)
    found = np.repeat([lost_from(levels, row) for row in shares], times).tolist()
    low, high = central_interval(found)
    _, k = _crossing(lost.mean(axis=0))
    if k is None:
        return low, high
    return min(low, float(levels[max(k - 1, 0)])), max(high, float(levels[k]))


def by_seed_interval(values: Sequence[tuple[int, float]]) -> tuple[float, float]:
    """95 % interval of the median of (seed, value): seeds are drawn whole; NaN of fewer than two.

    The runs of a seed are the same room at every level, so they are no samples of their own.
    """
    seeds, owners = np.unique([seed for seed, _ in values], return_inverse=True)
    if len(seeds) < 2:
        return math.nan, math.nan
    draws = bootstrap_draws(len(seeds))
    return central_interval(drawn_medians([v for _, v in values], draws, owners).tolist())


def by_level(rows: Sequence[Row], metric: str) -> dict[float, float]:
    """The median of each level that has one, infinite for failures as everywhere."""
    return {level: quantile(values, 0.5) for level, values in _at_levels(rows, metric).items()}


def drift_by_level(rows: Sequence[Row]) -> dict[float, float]:
    """The geometric mean of each level's drift (RPE per metre), infinite with a failure.

    When in a run a SLAM slips, and how far from the start, decides its ATE, and is chance. Drift
    counts each metre once. Its geometric mean weighs every seed alike, whatever its size.
    """
    return {
        level: math.exp(sum(math.log(max(value, LEAST_DRIFT)) for value in values) / len(values))
        for level, values in _at_levels(rows, DRIFT).items()
    }


def _at_levels(rows: Sequence[Row], metric: str) -> dict[float, list[float]]:
    """What the runs have of a metric, level by level, ascending."""
    found: dict[float, list[float]] = {}
    for row in rows:
        value = number(row, metric)
        if value is not None:
            found.setdefault(float(row["dynamism"]), []).append(value)
    return dict(sorted(found.items()))


def spearman(errors: Mapping[float, float]) -> float | None:
    """Rank correlation of level and error; None of fewer than three, or where all are equal."""
    if len(errors) < 3 or len(set(errors.values())) == 1:
        return None
    return float(spearmanr(list(errors), list(errors.values())).statistic)


def score(track: Track, slam: str, rows: Sequence[Row]) -> Row:
    """The row of one SLAM: ``rows`` are its runs on the track, each level with the same seeds."""
    low, high = by_seed_interval(_by_seed(rows, TRACKING))
    silent = _values(rows, SILENT)
    lost = summed([((int(row["seed"]),), row) for row in rows])
    return {
        "track": track.name,
        "slam": slam,
        "seeds": len({int(row["seed"]) for row in rows}),
        **lost,
        "failed_runs": sum(row["outcome"] in FAILED for row in rows),
        "lost_at_top": lost["lost_shares"][-1],
        f"{TRACKING}_low": low,
        f"{TRACKING}_high": high,
        SILENT: sum(silent) / len(silent) if silent else None,
        "spearman": spearman(drift_by_level(rows)),
        "spearman_ate": spearman(by_level(rows, ATE)),
        **{cost: quantile(v, 0.5) if (v := _values(rows, cost)) else None for cost in COSTS},
    }


def summed(runs: Sequence[tuple[tuple[Any, ...], Row]]) -> Row:
    """What was lost of a SLAM's runs, from which level on, and the error; a run with its room.

    A room, such as a seed of a track, is drawn whole: one without a run at each level gives none to
    the interval.
    """
    levels = sorted({float(row["dynamism"]) for _, row in runs})
    rooms = sorted({room for room, _ in runs})
    table = np.full((len(rooms), len(levels)), np.nan)
    for room, row in runs:
        table[rooms.index(room), levels.index(float(row["dynamism"]))] = row["lost"]
    low, high = lost_from_interval(levels, table[~np.isnan(table).any(axis=1)])
    shares, errors = np.nanmean(table, axis=0), _values([row for _, row in runs], TRACKING)
    return {
        "levels": levels,
        "lost_shares": shares.tolist(),
        "runs_at": (~np.isnan(table)).sum(axis=0).tolist(),
        "runs": len(runs),
        "lost_runs": int(np.nansum(table)),
        "lost_from": lost_from(levels, shares),
        "lost_from_low": low,
        "lost_from_high": high,
        TRACKING: quantile(errors, 0.5) if errors else None,
        f"{TRACKING}_runs": len(errors),
    }


def _values(rows: Sequence[Row], metric: str) -> list[float]:
    """As they are, where they are: what failed has no error while it was not lost."""
    return [value for _, value in _by_seed(rows, metric)]


def _by_seed(rows: Sequence[Row], metric: str) -> list[tuple[int, float]]:
    values = ((int(row["seed"]), row.get(metric)) for row in rows)
    return [(seed, float(v)) for seed, v in values if v is not None and not math.isnan(v)]


def fairness(track: Track, rows: Sequence[Row]) -> Row:
    """Whether the track counts, and the runs of the oracle that holds best: lost, error at worst.

    A published track says itself whether it counts; of any other the oracles' runs do.
    """
    best = min((_oracle(name, rows) for name in track.oracles), key=_badness)
    holds = best["oracle_runs"] > 0 and _badness(best) <= (False, FAIR_M)
    return best | {"counts": holds if track.counts is None else track.counts}


def _oracle(name: str, rows: Sequence[Row]) -> Row:
    own = [row for row in rows if row["slam"] == name]
    shares = [sum(lost) / len(lost) for lost in _at_levels(own, "lost").values()]
    return {
        "oracle": name,
        "oracle_runs": len(own),
        "oracle_error_m": max(by_level(own, TRACKING).values(), default=math.inf),
        "oracle_lost": sum(int(row["lost"]) for row in own),
        "oracle_lost_at_worst": max(shares, default=1.0),
    }


def _badness(of: Row) -> tuple[bool, float]:
    return of["oracle_lost_at_worst"] > FAIR_LOST, of["oracle_error_m"]


def scores(track: Track, rows: Sequence[Row]) -> tuple[Row, list[Row]]:
    """``fairness`` of the track, and a row for each SLAM that made all its runs, in their order."""
    fair = fairness(track, rows)
    every: dict[str, list[Row]] = {}
    for row in rows:
        every.setdefault(row["slam"], []).append(row)
    most = set(map(_run, rows))
    table = [score(track, s, own) for s, own in every.items() if set(map(_run, own)) == most]
    return fair, [row | {"counts": fair["counts"]} for row in table]


def _run(row: Row) -> tuple[float, int]:
    return float(row["dynamism"]), int(row["seed"])


RANKED = (
    "slam", "runs", "lost_runs", "lost_from", "lost_from_low", "lost_from_high",
    TRACKING, f"{TRACKING}_runs",
)  # fmt: skip


def same_runs(
    runs: Mapping[str, Sequence[Row]], subject: str
) -> dict[str, dict[tuple[str, float, int], Row]]:
    """By SLAM, its rows of those runs of the subject that half of the SLAMs made too.

    runs  rows by track
    """
    made: dict[str, dict[tuple[str, float, int], Row]] = {}
    for track, rows in runs.items():
        for row in rows:
            made.setdefault(row["slam"], {})[track, *_run(row)] = row
    times = Counter(run for own in made.values() for run in own)
    same = sorted(run for run in made.get(subject, ()) if 2 * times[run] > len(made))
    return {slam: {run: own[run] for run in same if run in own} for slam, own in made.items()}


def ranking(runs: Mapping[str, Sequence[Row]], subject: str) -> list[Row]:
    """SLAMs by the level they are lost from, then by the error while not lost.

    Who lacks one of ``same_runs`` has no place.
    """
    made = same_runs(runs, subject)
    of = [
        {"slam": slam, **summed([((track, seed), row) for (track, _, seed), row in own.items()])}
        for slam, own in made.items()
        if len(own) == len(made.get(subject, ())) > 0
    ]
    return sorted(
        of,
        key=lambda row: (
            -row["lost_from"],
            row["lost_runs"],
            math.inf if row[TRACKING] is None else row[TRACKING],
        ),
    )


def lost_of(rows: Iterable[Row], least: int = 1) -> dict[str, tuple[int, int]]:
    """By SLAM the runs lost and all, where it has at least so many of these."""
    found: dict[str, list[int]] = {}
    for row in rows:
        found.setdefault(row["slam"], []).append(int(row["lost"]))
    return {slam: (sum(own), len(own)) for slam, own in found.items() if len(own) >= least}


def lost_by_track(
    runs: Mapping[str, Sequence[Row]], subject: str
) -> dict[str, dict[str, tuple[int, int]]]:
    """By track and SLAM the runs lost and all, of ``same_runs``; who lacks one has none there."""
    found: dict[str, list[Row]] = {track: [] for track in runs}
    for own in same_runs(runs, subject).values():
        for (track, _, _), row in own.items():
            found[track].append(row)
    return {
        track: lost_of(rows, sum(row["slam"] == subject for row in rows))
        for track, rows in found.items()
    }


def worst(rows: Iterable[Row]) -> list[str]:
    """The tracks by the share of runs lost there, most first, then by error; rows of one SLAM."""

    def badness(row: Row) -> tuple[float, float]:
        error = row[TRACKING]
        return row["lost_runs"] / row["runs"], math.inf if error is None else error

    return [row["track"] for row in sorted(rows, key=badness, reverse=True)]
