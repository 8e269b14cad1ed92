# SPDX-License-Identifier: Apache-2.0
"""What stands at the marked places, by name, told from the results files alone."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

from scripts.metrics.table import METRICS
from scripts.quotes.results import (
    VERDICTS,
    Comparison,
    Interval,
    interval,
    made,
    shown,
    table,
    verdict,
)  # fmt: skip
from scripts.report.words import listed
from scripts.result_files import load

ATE, ALIGNED, LOST = "ate_unaligned_m", "ate_se2_m", "lost"
MOVING = "moving_share_of_returns"
OURS, GRID, EKF, NULL = "shunting", "occupancy", "ekf", "odometry"
MAPS = {
    "ghost_rate": ("ghosts, %", 2),
    "new_object_recall": ("new things found, %", 1),
    "half_life_s": ("half-life of an old place, s", 2),
    "door_accuracy": ("doors right, %", 1),
    "ms_per_scan_p50": ("processor time of a scan, ms", 1),
}
PAGE_COLUMNS = 120


def texts(results: Path) -> dict[str, str]:
    """By the name of the mark."""
    full = Comparison(results / "comparison.json")
    costs = load(results / "costs.json")
    return {
        "readme.comparison": _wrapped(readme_comparison(full)),
        "films.cost": _wrapped(film(costs)),
        "readme.demo": f"{costs['costs']['demo']['s']:.0f} s of processor time",
        "comparing.made": _wrapped(comparing_made(full)),
        "comparing.errors": errors(full),
        "comparing.differences": differences(full),
        "comparing.grid": _wrapped(comparing_grid(full)),
        "comparing.maps": maps(full),
        "comparing.cost": _wrapped(comparing_cost(full, costs)),
    }


def _wrapped(text: str) -> str:
    return textwrap.fill(text, PAGE_COLUMNS, break_long_words=False, break_on_hyphens=False)


def _medians(of: Comparison, scene: str, slam: str, metric: str = ATE) -> list[float]:
    return [level.value for level in of.levels(scene, slam, metric) if level is not None]


def _span(values: list[float], factor: float, places: int) -> str:
    """``1.5 to 1.9``."""
    low, high = shown(factor * min(values), places), shown(factor * max(values), places)
    return low if low == high else f"{low} to {high}"


def errors(of: Comparison) -> str:
    """Median error with its interval, a table for each scene."""
    head = [f"dynamism {level:g}" for level in of.data["dynamism"]]
    tables = []
    for scene in of.data["scenes"]:
        shares = [f"{100.0 * share:.1f}" for share in _medians(of, scene, OURS, MOVING)]
        rho = shown(of.rank_correlation(scene, OURS, MOVING), 1)
        rows = [["returns from what moves, %", *shares, rho, ""]]
        for slam in of.data["slams"]:
            places = 0 if slam == NULL else 1
            cells = [interval(level, ATE, places) for level in of.levels(scene, slam, ATE)]
            gone = sum(_lost(of, scene, slam))
            runs = len(of.data["dynamism"]) * len(of.data["seeds"])
            rho = shown(of.rank_correlation(scene, slam, ATE), 1)
            rows.append([f"`{slam}`", *cells, rho, f"{gone} of {runs}"])
        tables.append(table([scene, *head, "rank correlation", "runs lost"], rows))
    return "\n\n".join(tables)


def _lost(of: Comparison, scene: str, slam: str) -> list[int]:
    """Runs at each level."""
    return [round(share * len(of.data["seeds"])) for share in _medians(of, scene, slam, LOST)]


def differences(of: Comparison) -> str:
    """Error of shunting less the others', run by run; bold where the interval excludes zero."""
    head = ["cm", *(f"dynamism {level:g}" for level in of.data["dynamism"]), "over all levels"]
    rows = []
    for scene in of.data["scenes"]:
        for rival in _rivals(of):
            pairs = [*of.pairs(scene, rival, ATE), of.over_levels(scene, rival, ATE)]
            places = 0 if rival == NULL else 2
            cells = []
            for pair in pairs:
                cell = interval(pair, ATE, places)
                cells.append(f"**{cell}**" if verdict(pair, ATE) else cell)
            rows.append([f"{scene}, less `{rival}`", *cells])
    return table(head, rows)


def _rivals(of: Comparison) -> list[str]:
    return [slam for slam in of.data["slams"] if slam != OURS]


def maps(of: Comparison) -> str:
    """Medians of both maps over the levels, and the difference with its interval."""
    head = ["", "`shunting`", "`occupancy`", "difference over all levels", "verdict"]
    rows = []
    for scene in of.data["scenes"]:
        for metric, (name, places) in MAPS.items():
            if f"{scene} {OURS} {metric}" not in of.data["levels"]:
                continue
            factor = METRICS[metric].factor
            over = of.over_levels(scene, GRID, metric)
            word = VERDICTS[verdict(over, metric)]
            spans = [
                _span(_medians(of, scene, slam, metric), factor, places) for slam in (OURS, GRID)
            ]
            rows.append([f"{scene}: {name}", *spans, interval(over, metric, places), word])
    return table(head, rows)


def comparing_made(of: Comparison) -> str:
    """What was run, where and by which code."""
    rate = 37.5 / of.data["every"]
    return (
        f"Measured with the command at the top of this page: {len(of.data['seeds'])} runs of "
        f"{of.data['seconds']:g} s at each level, every error of the LMS-221, {rate:.1f} scans a "
        f"second, Pioneer-class odometry ({made(of.data, of.data['seeds'])}; all numbers: "
        "[results/comparison.json](results/comparison.json)). Median unaligned ATE in cm with its "
        "95 % interval, and the rank correlation of dynamism with the medians:"
    )


def comparing_cost(of: Comparison, costs: dict[str, Any]) -> str:
    """Of the whole comparison."""
    runs = len(of.data["scenes"]) * len(of.data["dynamism"]) * len(of.data["seeds"])
    row = costs["costs"]["comparison"]
    each = row["s"]
    return (
        f"A run with its four SLAMs takes {each:.0f} s of processor time "
        f"({made(costs, row['seeds'])}); the whole comparison, {runs} simulations and "
        f"{runs * len(of.data['slams'])} runs, about {round(runs * each / 60.0)} minutes."
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


def _against_grid(of: Comparison, metric: str = ATE) -> str:
    """``in the arena the two tie at dynamism 0 and 0.5, at 1 `shunting` is nearer (−48 cm, …)``."""
    words = {1: "`shunting` is nearer", -1: "**`occupancy` is nearer**"}
    said = []
    for scene in of.data["scenes"]:
        pairs = list(zip(of.data["dynamism"], of.pairs(scene, GRID, metric), strict=True))
        ties = [f"{level:g}" for level, pair in pairs if not verdict(pair, metric)]
        clear = [
            f"at {level:g} {words[verdict(pair, metric)]} ({_cm(pair)})"
            for level, pair in pairs if pair and verdict(pair, metric)
        ]  # fmt: skip
        told = [f"the two tie at dynamism {listed(ties)}"] if ties else []
        said.append(f"in the {scene} {', '.join([*told, *clear])}")
    return "; ".join(said)


def comparing_grid(of: Comparison) -> str:
    """The ordinary grid, level by level, unaligned and aligned."""
    return (
        "`shunting` less `occupancy`, the ordinary grid, run by run: "
        f"{_against_grid(of)}. With the paths aligned: {_against_grid(of, ALIGNED)}."
    )


def _cm(pair: Interval) -> str:
    value, low, high = (shown(100.0 * n, 2) for n in (pair.value, pair.low, pair.high))
    return f"{value} cm, 95 % interval [{low}, {high}]"


def readme_comparison(full: Comparison) -> str:
    """Under the picture of the README."""
    said, least, most = [], full.data["dynamism"][0], full.data["dynamism"][-1]
    for scene in full.data["scenes"]:
        ends = []
        for slam in (OURS, GRID, EKF):
            medians = _medians(full, scene, slam)
            ends.append(f"`{slam}` {100.0 * medians[0]:.1f} and {100.0 * medians[-1]:.1f}")
        said.append(f"in the {scene} {', '.join(ends)}")
    return (
        f"With every error of the scanner and each room's own crowd, the median position error in "
        f"cm at dynamism "
        f"{least:g} and {most:g} is {'; '.join(said)}. Against an "
        "ordinary grid with the same matcher (`occupancy`), run by run: "
        f"{_against_grid(full)}. Who wins where, and where `shunting` does not: "
        f"[docs/comparing.md](docs/comparing.md) ({made(full.data, full.data['seeds'])})."
    )
