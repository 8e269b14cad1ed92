# SPDX-License-Identifier: Apache-2.0
"""What stands at the marked places, by name, told from the results files alone."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from scripts.experiments.measured import table
from scripts.metrics.table import METRICS
from scripts.result_files import load
from slam.errors import LogFormatError

ATE, LOST, MOVING = "ate_unaligned_m", "lost", "moving_share_of_returns"
OURS, GRID, NULL = "shunting", "occupancy", "odometry"
MAPS = {
    "ghost_rate": ("ghosts, %", 2),
    "new_object_recall": ("new things found, %", 1),
    "half_life_s": ("half-life of an old place, s", 2),
    "door_accuracy": ("doors right, %", 1),
    "ms_per_scan_p50": ("processor time of a scan, ms", 1),
}
VERDICTS = {1: "better", -1: "**beaten**", 0: "no clear difference"}
PAGE_COLUMNS = 120
Cell = Sequence[Any] | None
"""Of a results file: a number, the ends of its 95 % interval, what else there is; None: nothing."""


@dataclass(frozen=True)
class Comparison:
    """``comparison.json``."""

    path: Path

    @cached_property
    def data(self) -> dict[str, Any]:
        """All of it."""
        return load(self.path)

    def row(self, table: str, scene: str, slam: str, metric: str = ATE) -> Any:
        """Of that table; ``LogFormatError`` where there is none."""
        try:
            return self.data[table][f"{scene} {slam} {metric}"]
        except KeyError as error:
            raise LogFormatError(self.path, f"lacks {error} in {table}") from error

    def medians(self, scene: str, slam: str, metric: str = ATE) -> list[float]:
        """Of the levels that have one."""
        return [float(cell[0]) for cell in self.row("levels", scene, slam, metric) if cell]


def texts(results: Path) -> dict[str, str]:
    """By the name of the mark."""
    full, costs = Comparison(results / "comparison.json"), load(results / "costs.json")
    return {
        "films.cost": _wrapped(film(costs)),
        "readme.demo": f"{costs['costs']['demo']['s']:.0f} s of processor time",
        "comparing.made": _wrapped(comparing_made(full.data)),
        "comparing.errors": errors(full),
        "comparing.differences": differences(full),
        "comparing.maps": maps(full),
    }


def _wrapped(text: str) -> str:
    return textwrap.fill(text, PAGE_COLUMNS, break_long_words=False, break_on_hyphens=False)


def errors(of: Comparison) -> str:
    """Median error with its interval, a table for each scene."""
    head = [f"dynamism {level:g}" for level in of.data["dynamism"]]
    seeds, tables = len(of.data["seeds"]), []
    for scene in of.data["scenes"]:
        shares = [f"{100.0 * share:.1f}" for share in of.medians(scene, OURS, MOVING)]
        rho = shown(of.row("rank_correlation", scene, OURS, MOVING), 1)
        rows = [["returns from what moves, %", *shares, rho, ""]]
        for slam in of.data["slams"]:
            places = 0 if slam == NULL else 1
            cells = [interval(cell, ATE, places) for cell in of.row("levels", scene, slam)]
            gone = sum(round(share * seeds) for share in of.medians(scene, slam, LOST))
            rho = shown(of.row("rank_correlation", scene, slam), 1)
            rows.append([f"`{slam}`", *cells, rho, f"{gone} of {len(head) * seeds}"])
        tables.append(table([scene, *head, "rank correlation", "runs lost"], rows))
    return "\n\n".join(tables)


def differences(of: Comparison) -> str:
    """Error of shunting less the others', run by run; bold where the interval excludes zero."""
    rows = []
    for scene in of.data["scenes"]:
        for rival in (slam for slam in of.data["slams"] if slam != OURS):
            own = [*of.row("paired", scene, rival), of.row("over_levels", scene, rival)]
            told = [(interval(cell, ATE, 0 if rival == NULL else 2), cell) for cell in own]
            cells = [f"**{text}**" if verdict(cell, ATE) else text for text, cell in told]
            rows.append([f"{scene}, less `{rival}`", *cells])
    head = [f"dynamism {level:g}" for level in of.data["dynamism"]]
    return table(["cm", *head, "over all levels"], rows)


def maps(of: Comparison) -> str:
    """Medians of both maps over the levels, and the difference with its interval."""
    rows = []
    for scene in of.data["scenes"]:
        for metric, (name, places) in MAPS.items():
            if f"{scene} {OURS} {metric}" not in of.data["levels"]:
                continue
            spans = [
                _span(of.medians(scene, slam, metric), metric, places) for slam in (OURS, GRID)
            ]
            over = of.row("over_levels", scene, GRID, metric)
            word = VERDICTS[verdict(over, metric)]
            rows.append([f"{scene}: {name}", *spans, interval(over, metric, places), word])
    head = ["", f"`{OURS}`", f"`{GRID}`", "difference over all levels", "verdict"]
    return table(head, rows)


def _span(values: Sequence[float], metric: str, places: int) -> str:
    """``1.5 to 1.9``."""
    factor = METRICS[metric].factor
    ends = dict.fromkeys(shown(factor * end, places) for end in (min(values), max(values)))
    return " to ".join(ends)


def comparing_made(data: dict[str, Any]) -> str:
    """What was run, where and by which code."""
    return (
        f"Measured with the command at the top of this page: {len(data['seeds'])} runs of "
        f"{data['seconds']:g} s at each level, every error of the LMS-221, "
        f"{37.5 / data['every']:.1f} scans a second, Pioneer-class odometry "
        f"({made(data, data['seeds'])}; all numbers: "
        "[results/comparison.json](results/comparison.json)). Median unaligned ATE in cm with its "
        "95 % interval, and the rank correlation of dynamism with the medians:"
    )


def film(costs: dict[str, Any]) -> str:
    """Of a second of film."""
    s = {name: row["s"] for name, row in costs["costs"].items()}
    measured = made(costs, costs["costs"]["film, with 3D"]["seeds"])
    return (
        "A second of film at 30 fps and 1280 × 720, simulation and SLAM included, takes "
        f"{s['film, without 3D']:.1f} s of processor time without the 3D view and "
        f"{s['film, with 3D']:.1f} s with it, drawn without a graphics card (480 × 300, ten times "
        f"a second); the encoder takes {s['encoder, with 3D']:.1f} s more ({measured})."
    )


def shown(value: Any, places: int) -> str:
    """``2.3``, ``−0.7``; ∞ for what never ends, – for no number."""
    number = math.nan if value is None else float(value)
    if math.isnan(number):
        return "–"
    digits = "∞" if math.isinf(number) else f"{abs(number):.{places}f}"
    return ("−" if number < 0.0 and digits.strip("0.") else "") + digits


def interval(cell: Cell, metric: str, places: int) -> str:
    """``1.8 [1.5, 2.0]`` in the metric's handy unit; – where there is none."""
    if cell is None:
        return "–"
    factor = METRICS[metric].factor
    value, low, high = (shown(n and factor * float(n), places) for n in cell[:3])
    return f"{value} [{low}, {high}]"


def verdict(cell: Cell, metric: str) -> int:
    """1 where shunting is better, -1 where it is beaten, 0 where the interval holds zero."""
    if cell is None or cell[1] is None or cell[2] is None:
        return 0
    low, high = float(cell[1]), float(cell[2])
    if not (low > 0.0 or high < 0.0):
        return 0
    return 1 if (high < 0.0) == bool(METRICS[metric].less_is_better) else -1


def made(data: dict[str, Any], seeds: Sequence[int]) -> str:
    """Commit, seeds and machine of a results file."""
    ran = f"seeds {seeds[0]} to {seeds[-1]}" if len(seeds) > 1 else f"seed {seeds[0]}"
    machine = data["machine"]
    return (
        f"commit {data['commit'][:7]}, {ran}, {machine['processor']} with {machine['cores']} "
        f"cores, Python {machine['python']}"
    )
