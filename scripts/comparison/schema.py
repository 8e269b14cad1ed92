# SPDX-License-Identifier: Apache-2.0
"""What a comparison on file is: its tables, the settings of its recipe, the arrays of its runs.

This is the one place that says so: ``Plan`` and the writer are held to it, and ``folder`` reads by
it, for ``report`` and ``verify`` alike. A table, a recipe or a run may hold more: a column, key or
array that is not named here is not read.
"""

import math
from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from scripts.comparison.rules import (
    LEVEL,
    MAX_MESSAGE,
    Array,
    Columns,
    Line,
    Table,
    level_of,
    many,
    number,
    word,
)
from scripts.metrics.table import COLUMNS as MEASURED
from scripts.metrics.table import METRICS
from scripts.options import AXES
from sim.recording.recipe import MAX_SECONDS
from sim.world.times_of_day import MOST_SESSIONS
from slam.answers import LEAST_CELL_M, MOST_CELL_M, MOST_M
from slam.shaped import Share

SCHEMA = 1
RUNS, LEVELS, PAIRED = "runs.csv", "levels.csv", "paired.csv"
AGES, AGES_LEVELS = "ages.csv", "ages_levels.csv"
FAILED = ("raised", "hung", "nan", "bad")
OUTCOMES = ("finished", "lost", *FAILED)
DAYS, ANEW = "days", "anew"  # of the column "map"
OLD = (1, 3, 10)  # sessions, of maps of some age
OVER_TIME = (
    "ghost_rate", "ghost_seen_rate", "recall", "map_kb", "memory_mb", "ms_per_scan", "load_s",
)  # fmt: skip
"""Columns of sessions of which there is an early and a late one. The last two are times."""
_NAME = word()
_SEED = number(most=2**63 - 1, whole=True)
_MAYBE_SHARE = number(most=1.0, optional=True)
_COUNT, _MAYBE_COUNT = number(most=1e9, whole=True), number(most=1e9, whole=True, optional=True)
_SIGNED, _ONE_OR_MORE = number(least=-math.inf), number(least=1, most=1e9, whole=True)
_POSITIVE, _MAYBE = number(), number(optional=True)
_MAYBE_ONE = number(most=1.0, whole=True, optional=True)
_FAILURE = word(most=MAX_MESSAGE, optional=True)


# "dynamism" is the level, of whatever axis: a table over motion or change calls it so on file.
_RUNS: Columns = {
    "scene": _NAME, "dynamism": level_of("dynamism"), "seed": _SEED, "slam": _NAME,
    "outcome": word(among=OUTCOMES), "failure": _FAILURE, "scans": _COUNT,
    **{
        key: number(least=of.least, most=of.most, whole=of.whole, optional=True)
        for key, of in METRICS.items() if key in MEASURED
    },
    "lost": number(most=1.0, whole=True),
}  # fmt: skip
_SUMMARY: Columns = {
    "metric": word(among=tuple(METRICS)), "statistic": word(among=("median", "share")),
    "n": _ONE_OR_MORE, "value": _SIGNED, "low": _SIGNED, "high": _SIGNED,
}  # fmt: skip
_LEVELS: Columns = {
    "scene": _NAME, "dynamism": level_of("dynamism"), "slam": _NAME, **_SUMMARY,
    "q25": number(least=-math.inf, optional=True), "q75": number(least=-math.inf, optional=True),
}  # fmt: skip
_PAIRED: Columns = {
    "scene": _NAME, "dynamism": level_of("dynamism"), "metric": word(among=tuple(METRICS)),
    "slam_a": _NAME, "slam_b": _NAME, "n": _SUMMARY["n"],
    "median_difference": _SIGNED, "low": _SIGNED, "high": _SIGNED,
    "wins": _COUNT, "ties": _COUNT, "losses": _COUNT, "p_sign": Share,
}  # fmt: skip
_BUILDING: Columns = {"scene": _NAME, "motion": Share, "change": Share}
_TO_FIND = ("to_find", "found", "found_soon", "wrong", "known", "known_soon")
_AGES: Columns = {
    **_BUILDING, "seed": _SEED, "slam": _NAME, "map": word(among=(DAYS, ANEW)),
    "sessions": number(least=1.0, most=MOST_SESSIONS, whole=True), "failed": _COUNT,
    "failure": _FAILURE, **dict.fromkeys(_TO_FIND, _MAYBE_COUNT),
    "found_share": _MAYBE_SHARE, "found_soon_share": _MAYBE_SHARE,
    **dict.fromkeys(("rmse_session0_m", "rmse_session1_m", "rmse_last_m", "rmse_growth"), _MAYBE),
    **{
        name: kind
        for age in OLD
        for name, kind in ((f"right_age{age}", _MAYBE_ONE), (f"rmse_age{age}_m", _MAYBE))
    },
    **{f"{name}_{when}": _MAYBE for name in OVER_TIME for when in ("early", "late")},
    "outdated_told": _MAYBE, "outdated_false": _MAYBE,
}  # fmt: skip
_AGES_LEVELS: Columns = {
    **_BUILDING, "slam": _NAME, **_SUMMARY, "metric": _NAME,
}  # fmt: skip
TABLES: Mapping[str, Table] = {
    RUNS: Table(columns=_RUNS, key=("scene", "dynamism", "seed", "slam")),
    LEVELS: Table(columns=_LEVELS, key=("scene", "dynamism", "slam", "metric")),
    PAIRED: Table(columns=_PAIRED, key=("scene", "dynamism", "metric", "slam_a", "slam_b")),
    AGES: Table(
        columns=_AGES, key=("scene", "motion", "change", "seed", "slam"), together=_TO_FIND,
        parts=(
            ("failed", "sessions"), ("found", "to_find"), ("found_soon", "to_find"),
            ("wrong", "to_find"), ("known", "to_find"), ("known_soon", "known"),
        ),
    ),
    AGES_LEVELS: Table(columns=_AGES_LEVELS, key=("scene", "motion", "change", "slam", "metric")),
}  # fmt: skip
"""By file."""


class Machine(Struct):
    """What a study was made on, as far as it is read."""

    processor: Line


def settings(axis: str) -> Columns:
    """The settings of a recipe, levels being of that axis."""
    return {
        "compare_schema": number(least=SCHEMA, most=SCHEMA, whole=True),
        "slams": many(_NAME), "scenes": many(_NAME), "levels": many(level_of(axis)),
        "seeds": many(_SEED), "seconds": number(most=MAX_SECONDS),
        "every": number(least=1.0, most=1000.0, whole=True), "scanner": _NAME,
        "scan_limit_s": number(most=1e9), "lost_rule": word(),
        "machine": Machine,
    }  # fmt: skip


LATER: Columns = {
    "axis": word(among=(*AXES, LEVEL)), "motion": _MAYBE_SHARE, "change": _MAYBE_SHARE,
    "crowd": word(optional=True), "odometry": _NAME, "sets": list[dict[str, Any]],
    "judge_maps": bool,
    "sessions": number(least=2.0, most=MOST_SESSIONS, whole=True, optional=True),
    "scene_sha256": dict[str, Line],
}  # fmt: skip
"""Settings that recipes of before did not have."""
NOT_ASKED = ("axis", "odometry", "sets", "judge_maps", "scene_sha256")
"""Those of them that are no options of ``mobilia compare``."""
RECIPE: Columns = {
    "command": word(among=("compare",)), "settings": dict[str, Any], "versions": dict[str, Any],
}  # fmt: skip
"""The recipe around them."""


def _poses(*shape: int | str) -> Array:
    """Of places and headings, m and rad."""
    return Array(kinds="f", shape=shape, least=-MOST_M, most=MOST_M)


_CELL_M = Array(kinds="f", least=LEAST_CELL_M, most=MOST_CELL_M)
_POSE = _poses(3)
RUN: Mapping[str, Array] = {
    "schema": Array(kinds="iu", least=SCHEMA, most=SCHEMA),
    "slams": Array(kinds="U", shape=("slams",)),
    "stamps_ns": Array(kinds="i", shape=("scans",), rising=True),
    "truth": _poses("scans", 3),
    "ranges": Array(kinds="f", shape=("scans", "beams"), finite=False),
    "hit": Array(kinds="i", shape=("scans", "beams"), least=-2.0, most=2.0**15),
    "mover_poses": _poses("scans", "movers", 3),
    "moving": Array(kinds="b", shape=("scans", "movers")),
    "names": Array(kinds="U", shape=("movers",)),
    "kinds": Array(kinds="U", shape=("movers",)),
    "radii_m": Array(kinds="f", shape=("movers",), most=MOST_M),
    "closed": _poses("movers", 3),
    "static_map": Array(kinds="u", shape=("rows", "columns"), most=1.0),
    "static_map_resolution_m": _CELL_M,
    "T_world_origin": _POSE,
    "laser_angle_min": Array(kinds="f", least=-100.0, most=100.0),
    "laser_angle_increment": Array(kinds="f", least=-100.0, most=100.0),
    "laser_range_max": Array(kinds="fi", most=MOST_M),  # whole where a scanner's name has it whole
    "laser_T_robot_laser": _POSE,
}
"""The arrays of a file of ``runs/``; what is called alike has the same length."""
ENTRY: Mapping[str, Array] = {
    "stamps_ns": Array(kinds="i", shape=("answered",), rising=True),
    "poses": _poses("answered", 3),
    "covariances": Array(kinds="f", shape=("answered", 3, 3), least=-math.inf),
    "converged": Array(kinds="b", shape=("answered",)),
    "milliseconds": Array(kinds="f", shape=("answered",)),
}
"""Those of each SLAM in it, after ``slam0_`` and so on: of the first scans, which it answered."""
ENTRY_MAP: Mapping[str, Array] = {
    "map": Array(kinds="u", shape=("map rows", "map columns"), most=255.0),
    "map_resolution_m": _CELL_M,
    "T_map_origin": _POSE,
}
"""And of its last map: all three or none."""
