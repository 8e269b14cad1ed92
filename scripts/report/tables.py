# SPDX-License-Identifier: Apache-2.0
"""The tables of the report."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from scripts.comparison.schema import OUTCOMES
from scripts.comparison.tables import Row, by_seed, number
from scripts.metrics.table import METRICS, Metric, digits
from scripts.pages.table import NONE, Cell, Table, grid
from scripts.report.answer import percent
from scripts.report.study import LEAST_RUNS, Study, verdict
from slam.evaluation.statistics import quantile, ratio_interval
from slam.variants import ORACLE

_MARKS = {1: "better", -1: "worse", 0: ""}
_ATE, _LOST = METRICS["ate_unaligned_m"], METRICS["lost"]


def _by_measure(
    study: Study,
    where: str,
    having: Mapping[Metric, Sequence[str]],
    cell: Callable[[Metric, float, str], Cell],
    minus: str = "",
) -> list[Table]:
    """A table for each measure: a row for each level, a column for each SLAM that has it.

    One table for all with a single level (a row for each SLAM), and for the measures that one SLAM
    alone has. ``minus``: whose difference from each of these it is.
    """
    if len(study.levels) == 1 and having:
        at = study.levels[0]
        having_any = [slam for slam in study.slams if any(slam in own for own in having.values())]
        corner = f"{minus} minus" if minus else "SLAM"
        return [
            grid(f"{where} at {study.axis} {at:g}", corner, having_any, list(having),
                 lambda slam, metric: cell(metric, at, slam))
        ]  # fmt: skip

    def of_one(slam: str) -> Callable[[float, Metric], Cell]:
        return lambda level, metric: cell(metric, level, slam)

    found, single = [], dict[str, list[Metric]]()
    for metric, slams in having.items():
        if len(slams) == 1:
            single.setdefault(slams[0], []).append(metric)
            continue
        caption = f"{metric.heading}: {minus} minus …" if minus else metric.heading
        own = partial(cell, metric)
        found.append(grid(caption, study.axis, study.levels, slams, own, slams=slams))
    for slam, metrics in single.items():
        caption = f"{minus} minus {slam}" if minus else slam
        found.append(grid(caption, study.axis, study.levels, metrics, of_one(slam)))
    return found


def of_levels(study: Study, scene: str, metrics: Sequence[Metric]) -> list[Table]:
    """Medians (shares) with their 95 % intervals of the measures that any SLAM has."""
    having = {
        metric: [
            slam for slam in study.slams
            if any(study.level(scene, level, slam, metric.key) for level in study.levels)
        ]
        for metric in metrics
    }  # fmt: skip
    having = {metric: slams for metric, slams in having.items() if slams}

    def cell(metric: Metric, level: float, slam: str) -> Cell:
        rated = [study.level(scene, level, one, metric.key) for one in having[metric]
                 if not one.startswith(ORACLE)]  # fmt: skip
        row = study.level(scene, level, slam, metric.key)
        is_best = row in rated and row and not study.few and row["value"] == _best(rated, metric)
        return _value(row, metric, "best" if is_best else "")

    return _by_measure(study, scene, having, cell)


def _best(rows: Sequence[Row | None], metric: Metric) -> float | None:
    values = [float(row["value"]) for row in rows if row is not None]
    if len(values) < 2 or metric.less_is_better is None or len(set(values)) == 1:
        return None
    return min(values) if metric.less_is_better else max(values)


def _value(row: Row | None, metric: Metric, mark: str = "") -> Cell:
    """With its interval; of too few runs without, and of shares the count."""
    if row is None:
        return Cell(text=NONE)
    if row["n"] < LEAST_RUNS:
        return _count(row) if metric.summary == "share" else Cell(text=metric.show(row["value"]))
    ends = (row["low"], row["high"])
    interval = "" if ends == (math.inf, math.inf) else " to ".join(map(metric.show, ends))
    return Cell(text=metric.show(row["value"]), small=interval, mark=mark)


def _count(row: Row | None) -> Cell:
    """Of a share how many of how many, with its interval."""
    if row is None:
        return Cell(text=NONE)
    hits, runs = round(row["value"] * row["n"]), int(row["n"])
    return Cell(text=f"{hits} of {runs}", small=percent(hits, runs))


def of_pairs(study: Study, scene: str, metrics: Sequence[Metric]) -> list[Table]:
    """The subject against each rival: median difference, its interval, wins-ties-losses."""
    subject = study.subject

    def cell(metric: Metric, level: float, rival: str) -> Cell:
        return _difference(study.pair(scene, level, metric.key, subject, rival), metric)

    having = dict.fromkeys(metrics, study.rivals) if study.rivals else {}
    return _by_measure(study, scene, having, cell, minus=subject)


def _difference(row: Row | None, metric: Metric) -> Cell:
    if row is None:
        return Cell(text=NONE)
    ends = [metric.show(row[end], sign=True) for end in ("low", "high")]
    interval = f"{ends[0]} to {ends[1]}\n" if row["n"] >= LEAST_RUNS else ""
    return Cell(
        text=metric.show(row["median_difference"], sign=True),
        small=f"{interval}{row['wins']:g}–{row['ties']:g}–{row['losses']:g}",
        mark=_MARKS[verdict(row, bool(metric.less_is_better))],
    )


def of_outcomes(study: Study) -> list[Table]:
    """How the runs of each SLAM ended: for each scene, a column for each level.

    At one level it is one table with a column for each scene.
    """
    head = f"finished at {study.axis}"
    if len(study.levels) == 1:
        at = study.levels[0]
        return [
            grid(f"{head} {at:g}", "finished", study.slams, study.scenes,
                 lambda slam, scene: _ended(study, scene, slam, at))
        ]  # fmt: skip
    return [
        grid(scene, head, study.slams, study.levels, partial(_ended, study, scene))
        for scene in study.scenes
    ]


def _ended(study: Study, scene: str, slam: str, level: float) -> Cell:
    ended = Counter(row["outcome"] for row in study.runs(scene, level, slam))
    rest = [f"{ended[word]} {word}" for word in OUTCOMES[1:] if ended[word]]
    text = f"{ended['finished']} of {ended.total()}"
    return Cell(text=text, small=", ".join(rest), mark="worse" if rest else "")


def growth(study: Study, scene: str) -> Table:
    """What the axis does to each SLAM: from the lowest level to the highest."""
    ends = (study.levels[0], study.levels[-1])
    rows = [
        [
            Cell(text=slam),
            *(_value(study.level(scene, end, slam, _ATE.key), _ATE) for end in ends),
            _growth(study, scene, slam),
            *(_count(study.level(scene, end, slam, _LOST.key)) for end in ends),
        ]
        for slam in study.slams
    ]
    heads = [f"{_ATE.name} at {end:g}, {_ATE.shown}" for end in ends]
    lost = [f"{_LOST.name} at {end:g}" for end in ends]
    caption = f"From {study.axis} {ends[0]:g} to {ends[1]:g}"
    return Table(caption=caption, head=["SLAM", *heads, "grows", *lost], rows=rows)


def _growth(study: Study, scene: str, slam: str) -> Cell:
    """The ratio of the medians at both ends over the same seeds, with its interval."""
    low, high = (
        by_seed(study.runs(scene, end, slam), slam, _ATE.key)
        for end in (study.levels[0], study.levels[-1])
    )
    seeds = sorted(low.keys() & high.keys())
    before, after = [low[seed] for seed in seeds], [high[seed] for seed in seeds]
    if len(seeds) < LEAST_RUNS or not 0.0 < quantile(before, 0.5) < math.inf:
        return Cell(text=NONE)
    interval = " to ".join(map(digits, ratio_interval(before, after)))
    return Cell(text=digits(quantile(after, 0.5) / quantile(before, 0.5)) + " ×", small=interval)


def worst(study: Study, scene: str) -> Table:
    """The worst runs of the subject: how each ended, and how far it was from the truth."""
    rows = [
        (f"{row['dynamism']:g}", f"{row['seed']:g}", str(row["outcome"]),
         _ATE.show(number(row, _ATE.key)),
         NONE if row["lost_at_s"] is None else f"{row['lost_at_s']:.1f}")
        for row in study.worst(scene, study.subject)
    ]  # fmt: skip
    return Table(
        caption=f"Worst runs of {study.subject} in {scene}",
        head=[study.axis, "seed", "outcome", f"{_ATE.name}, {_ATE.shown}", "lost at, s"],
        rows=[[Cell(text=text) for text in row] for row in rows],
    )


def costs(study: Study, metrics: Sequence[Metric]) -> Table:
    """A row for each SLAM: medians over all runs' levels, per measure."""

    def cell(slam: str, metric: Metric) -> Cell:
        of = (slam, metric.key)
        levels = study.compared.levels
        found = sorted(row["value"] for row in levels if (row["slam"], row["metric"]) == of)
        span = f"{metric.show(found[0])} to {metric.show(found[-1])}" if found else ""
        return Cell(text=metric.show(found[len(found) // 2] if found else None), small=span)

    caption = "middle of the medians of all scenes and levels, and their range"
    return grid(caption, "SLAM", study.slams, metrics, cell)
