# SPDX-License-Identifier: Apache-2.0
"""The summary in words: who wins where, by how much, and where the subject is beaten."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scripts.metrics.row import Metric
from scripts.metrics.table import EXPLAINED, METRICS
from scripts.report.study import Study, verdict

ATE = METRICS["ate_unaligned_m"]
_JUDGED = tuple(metric for metric in EXPLAINED if metric.better)


def listed(words: list[str]) -> str:
    """a, b and c."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]


def levels_text(levels: list[float], of: list[float], axis: str = "dynamism") -> str:
    """Of levels: "at dynamism 0 and 0.5", "at every level"."""
    if len(levels) == len(of):
        return "at every level" if len(of) > 1 else f"at {axis} {levels[0]:g}"
    return f"at {axis} " + listed([f"{level:g}" for level in levels])


def leaders(study: Study, scene: str) -> list[str]:
    """Who has the lowest median position error at which levels; nothing of too few runs.

    Oracles take no part: they are shown what nobody else is.
    """
    if study.few:
        return []
    led: dict[str, list[float]] = {}
    for dynamism in study.levels:
        found = []
        for slam in (study.subject, *study.contestants):
            row = study.level(scene, dynamism, slam, ATE.key)
            if row is not None and math.isfinite(row["value"]):
                found.append((row["value"], slam))
        if found:
            led.setdefault(min(found)[1], []).append(dynamism)
    return [
        f"{slam} has the lowest median position error {levels_text(at, study.levels, study.axis)}"
        + _clearly(study, scene, slam, at)
        for slam, at in led.items()
    ]


def _clearly(study: Study, scene: str, slam: str, levels: list[float]) -> str:
    """Whether its lead is more than chance, against everybody and at all these levels."""
    others = [other for other in (study.subject, *study.contestants) if other != slam]
    if not others:
        return "."
    unclear = [
        other
        for other in others
        if not all(
            (row := study.pair(scene, level, ATE.key, slam, other)) and verdict(row, True) == 1
            for level in levels
        )
    ]
    if not unclear:
        return ", clearly before every other."
    return f"; its lead over {listed(unclear)} is not clear everywhere there."


@dataclass(frozen=True, kw_only=True)
class Against:
    """Where one SLAM is better or worse than a rival, and in which measures (by how much)."""

    rival: str
    where: str
    measures: list[str]


def against_subject(study: Study, side: int) -> list[Against]:
    """Where the subject is beaten (``side`` -1) or better (1), by rival and place."""
    found: dict[tuple[str, str], list[str]] = {}
    for rival in study.contestants:
        for metric in _JUDGED:
            where, most = _places(study, rival, metric, side)
            if where:
                words = f"{metric.name} ({metric.show(most)} {metric.shown})"
                found.setdefault((rival, where), []).append(words)
    return [
        Against(rival=rival, where=where, measures=measures)
        for (rival, where), measures in found.items()
    ]


def _places(study: Study, rival: str, metric: Metric, side: int) -> tuple[str, float]:
    """Scenes and levels with that verdict, in words, and the largest median difference there."""
    places: dict[str, list[float]] = {}
    most = 0.0
    for scene in study.scenes:
        for level in study.levels:
            row = study.pair(scene, level, metric.key, study.subject, rival)
            if row is None or verdict(row, bool(metric.less_is_better)) != side:
                continue
            places.setdefault(scene, []).append(level)
            most = max(most, abs(row["median_difference"] or 0.0))
    if len(study.scenes) > 1 and all(places.get(s) == study.levels for s in study.scenes):
        return "everywhere", most
    said = [f"{scene} {levels_text(at, study.levels, study.axis)}" for scene, at in places.items()]
    return "; ".join(said), most
