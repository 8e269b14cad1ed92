# SPDX-License-Identifier: Apache-2.0
"""The tables of the report, as heads and rows of cells."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from scripts.closed_loop.tables import Driven
from scripts.comparison.schema import OUTCOMES
from scripts.comparison.tables import Row, by_seed, number
from scripts.metrics.table import METRICS, Metric, digits
from scripts.pages.page import Cell, Table
from scripts.report.answer import percent
from scripts.report.curves import PRECISION, SUCCESS, few_goals
from scripts.report.study import LEAST_RUNS, Study, verdict
from slam.evaluation.statistics import quantile, ratio_interval
from slam.variants import ORACLE

_MARKS = {1: "better", -1: "worse", 0: ""}


def _label(of: str | float | Metric) -> str:
    """What a row or a column is called."""
    return of if isinstance(of, str) else of.heading if isinstance(of, Metric) else f"{of:g}"


def _grid(
    caption: str,
    corner: str,
    rows: Sequence[Any],
    columns: Sequence[Any],
    cell: Callable[[Any, Any], Cell],
    slams: Sequence[str] = (),
) -> Table:
    """A row for each of ``rows``, a column for each of ``columns``."""
    lines = [[Cell(text=_label(row)), *(cell(row, column) for column in columns)] for row in rows]
    head = [corner, *map(_label, columns)]
    return Table(caption=caption, head=head, rows=lines, slams=slams)


def of_levels(study: Study, scene: str, metrics: Sequence[Metric]) -> list[Table]:
    """Medians (shares) with their 95 % intervals of the measures that any SLAM has.

    A table for each measure: a row for each level, a column for each SLAM. One table for all with a
    single level (a row for each SLAM), and for the measures that one SLAM alone has.
    """
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

    if len(study.levels) == 1 and having:
        slams = [slam for slam in study.slams if any(slam in own for own in having.values())]
        at = study.levels[0]
        return [
            _grid(f"{scene} at {study.axis} {at:g}", "SLAM", slams, list(having),
                  lambda slam, metric: cell(metric, at, slam))
        ]  # fmt: skip
    alone: dict[str, list[Metric]] = {}
    for metric, slams in having.items():
        if len(slams) == 1:
            alone.setdefault(slams[0], []).append(metric)
    return [
        *(
            _grid(metric.heading, study.axis, study.levels, slams,
                  partial(cell, metric), slams)
            for metric, slams in having.items() if len(slams) > 1
        ),
        *(
            _grid(slam, study.axis, study.levels, own,
                  lambda level, metric: cell(metric, level, having[metric][0]))
            for slam, own in alone.items()
        ),
    ]  # fmt: skip


def _best(rows: Sequence[Row | None], metric: Metric) -> float | None:
    values = [float(row["value"]) for row in rows if row is not None]
    if len(values) < 2 or metric.less_is_better is None or len(set(values)) == 1:
        return None
    return min(values) if metric.less_is_better else max(values)


def _value(row: Row | None, metric: Metric, mark: str = "") -> Cell:
    """With its interval; of too few runs without, and of shares the count."""
    if row is None:
        return Cell(text="–")
    if row["n"] < LEAST_RUNS:
        return _count(row) if metric.summary == "share" else Cell(text=metric.show(row["value"]))
    ends = (row["low"], row["high"])
    interval = "" if ends == (math.inf, math.inf) else " to ".join(map(metric.show, ends))
    return Cell(text=metric.show(row["value"]), small=interval, mark=mark)


def _count(row: Row | None) -> Cell:
    """Of a share how many of how many, with its interval."""
    if row is None:
        return Cell(text="–")
    hits, runs = round(row["value"] * row["n"]), int(row["n"])
    return Cell(text=f"{hits} of {runs}", small=percent(hits, runs))


def of_pairs(study: Study, scene: str, metrics: Sequence[Metric]) -> list[Table]:
    """The subject against each rival: median difference, its interval, wins-ties-losses.

    A table for each measure: a row for each level, a column for each rival. One table for all
    measures with a single rival, or a single level.
    """
    subject, rivals, levels = study.subject, study.rivals, study.levels

    def cell(metric: Metric, level: float, rival: str) -> Cell:
        return _difference(study.pair(scene, level, metric.key, subject, rival), metric)

    if len(rivals) == 1:
        return [
            _grid(f"{subject} minus {rivals[0]}", study.axis, levels, metrics,
                  lambda level, metric: cell(metric, level, rivals[0]))
        ]  # fmt: skip
    if len(levels) == 1:
        return [
            _grid(f"{scene} at {study.axis} {levels[0]:g}", f"{subject} minus", rivals, metrics,
                  lambda rival, metric: cell(metric, levels[0], rival))
        ]  # fmt: skip
    return [
        _grid(f"{metric.heading}: {subject} minus …", study.axis, levels, rivals,
              partial(cell, metric), rivals)
        for metric in metrics
    ]  # fmt: skip


def _difference(row: Row | None, metric: Metric) -> Cell:
    if row is None:
        return Cell(text="–")
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

    def cell(scene: str, slam: str, level: float) -> Cell:
        ended = Counter(row["outcome"] for row in study.runs(scene, level, slam))
        rest = [f"{ended[word]} {word}" for word in OUTCOMES[1:] if ended[word]]
        text = f"{ended['finished']} of {ended.total()}"
        return Cell(text=text, small=", ".join(rest), mark="worse" if rest else "")

    head = f"finished at {study.axis}"
    if len(study.levels) == 1:
        at = study.levels[0]
        return [
            _grid(f"{head} {at:g}", "finished", study.slams, study.scenes,
                  lambda slam, scene: cell(scene, slam, at))
        ]  # fmt: skip
    return [
        _grid(scene, head, study.slams, study.levels,
              partial(cell, scene))
        for scene in study.scenes
    ]  # fmt: skip


def growth(study: Study, scene: str) -> Table:
    """What the axis does to each SLAM: from the lowest level to the highest."""
    ate, lost = METRICS["ate_unaligned_m"], METRICS["lost"]
    ends = (study.levels[0], study.levels[-1])
    rows = []
    for slam in study.slams:
        found = [study.level(scene, end, slam, ate.key) for end in ends]
        shares = [study.level(scene, end, slam, lost.key) for end in ends]
        rows.append([
            Cell(text=slam), *(_value(row, ate) for row in found), _growth(study, scene, slam),
            *(_count(row) for row in shares),
        ])  # fmt: skip
    head = [f"{ate.name} at {end:g}, {ate.shown}" for end in ends]
    lost_head = [f"{lost.name} at {end:g}" for end in ends]
    caption = f"From {study.axis} {ends[0]:g} to {ends[1]:g}"
    return Table(caption=caption, head=["SLAM", *head, "grows", *lost_head], rows=rows)


def _growth(study: Study, scene: str, slam: str) -> Cell:
    """The ratio of the medians at both ends over the same seeds, with its interval."""
    low, high = (
        by_seed(study.runs(scene, end, slam), slam, "ate_unaligned_m")
        for end in (study.levels[0], study.levels[-1])
    )
    seeds = sorted(low.keys() & high.keys())
    before, after = [low[seed] for seed in seeds], [high[seed] for seed in seeds]
    if len(seeds) < LEAST_RUNS or not 0.0 < quantile(before, 0.5) < math.inf:
        return Cell(text="–")
    interval = " to ".join(map(digits, ratio_interval(before, after)))
    return Cell(text=digits(quantile(after, 0.5) / quantile(before, 0.5)) + " ×", small=interval)


def worst(study: Study, scene: str) -> Table:
    """The worst runs of the subject: how each ended, and how far it was from the truth."""
    ate = METRICS["ate_unaligned_m"]
    rows = []
    for row in study.worst(scene, study.subject):
        at = row["lost_at_s"]
        cells = [f"{row['dynamism']:g}", f"{row['seed']:g}", str(row["outcome"])]
        cells += [ate.show(number(row, ate.key)), "–" if at is None else f"{at:.1f}"]
        rows.append([Cell(text=text) for text in cells])
    head = [study.axis, "seed", "outcome", f"{ate.name}, {ate.shown}", "lost at, s"]
    return Table(caption=f"Worst runs of {study.subject} in {scene}", head=head, rows=rows)


def costs(study: Study, keys: Sequence[str]) -> Table:
    """A row for each SLAM: medians over all runs' levels, per measure."""

    def cell(slam: str, metric: Metric) -> Cell:
        of = (slam, metric.key)
        levels = study.compared.levels
        found = sorted(row["value"] for row in levels if (row["slam"], row["metric"]) == of)
        span = f"{metric.show(found[0])} to {metric.show(found[-1])}" if found else ""
        return Cell(text=metric.show(found[len(found) // 2] if found else None), small=span)

    caption = "middle of the medians of all scenes and levels, and their range"
    metrics = [METRICS[key] for key in keys if study.has(key)]
    return _grid(caption, "SLAM", study.slams, metrics, cell)


def of_drive(drive: Driven) -> Table:
    """Of ``mobilia drive``: a row for each SLAM and level."""
    rows = [
        [
            Cell(text=str(row["slam"])),
            Cell(text=f"{row['dynamism']:g}"),
            Cell(
                text=f"{row['reached']:g} of {row['goals']:g}",
                small=_interval(row),
            ),
            *(Cell(text=f"{row[key]:g}") for key in ("wrong", "given_up", "failed")),
            _precision(row),
            *(_number(row[key]) for key in ("time_s", "collisions_per_km", "near_misses_per_km")),
            _lost(row),
        ]
        for slam in drive.slams
        for row in drive.of(slam)
    ]  # fmt: skip
    head = ["SLAM", drive.axis, "reached", "wrong", "given up", "failed", "precision, cm",
            "time, s", "collisions per km", "near misses per km", "runs lost"]  # fmt: skip
    return Table(caption=drive.scene, head=head, rows=rows)


def _interval(row: Row) -> str:
    if few_goals(row, SUCCESS):
        return ""
    return f"{100.0 * row['success_low']:.0f} to {100.0 * row['success_high']:.0f} %"


def _lost(row: Row) -> Cell:
    interval = percent(int(row["runs_lost"]), int(row["runs"]))
    recovered = f"{row['runs_recovered']:g} recovered"
    return Cell(
        text=f"{row['runs_lost']:g} of {row['runs']:g}",
        small=f"{interval}\n{recovered}" if interval else recovered,
    )


def _precision(row: Row) -> Cell:
    low, high = (row[key] for key in PRECISION[1:])
    small = ""
    if not few_goals(row, PRECISION) and low is not None and high is not None:
        small = f"{digits(100 * low)} to {digits(100 * high)}"
    return Cell(text=_number(row["precision_m"], 100.0).text, small=small)


def _number(value: float | None, factor: float = 1.0) -> Cell:
    return Cell(text="–" if value is None else digits(value * factor))
