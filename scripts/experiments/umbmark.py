# SPDX-License-Identifier: Apache-2.0
"""UMBmark (Borenstein and Feng): squares both ways round tell systematic from random errors.

    python -m scripts.experiments.umbmark --out docs

drives the wheel odometry of ``sim.sensors.odometry.encoders`` round a 4 m square five times each
way for several robots, and estimates each robot's Eb and Ed from the mean end errors by the
method's own formulas. Draws the picture of ``odometry.md`` and fills in its tables.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scripts.figures import save
from scripts.marks import fill_page, table
from sim.sensors.odometry.encoders import OdometryConfig, WheelOdometry
from slam.frames import Float

SIDE, TRACK = 4.0, 0.33  # m
SPEED, TURNING, RATE = 0.5, 0.8, 15.0  # m/s, rad/s, 1/s
RUNS, ROBOTS = 5, 30
PRESETS = ("pioneer3dx", "probabilistic_robotics", "ideal")
HEADS = ("robot", "Eb true", "Eb by UMBmark", "Ed true", "Ed by UMBmark", "farther centre")
PRESET_HEADS = ("preset", "farther centre (systematic)", "spread of one way's ends (random)")
BLUE, RED, INK = "#1f61be", "#ce2c3c", "#222222"


@dataclass(frozen=True, kw_only=True)
class Unit:
    """One robot: its true errors, and what UMBmark makes of its runs.

    errors    Es, Eb, Ed
    ends      (2, runs, 2) true minus reported end, m; counter-clockwise runs first
    """

    errors: tuple[float, float, float]
    ends: Float

    @property
    def centres(self) -> Float:
        """(2, 2) mean end errors m: the systematic part."""
        centres: Float = self.ends.mean(axis=1)
        return centres

    @property
    def worst(self) -> float:
        """UMBmark's measure of accuracy: the farther of the two centres, m."""
        return max(math.hypot(*centre) for centre in self.centres.tolist())

    @property
    def estimate(self) -> tuple[float, float]:
        """(Eb, Ed) by Borenstein and Feng's formulas, from the x coordinates of the centres."""
        (x_ccw, _), (x_cw, _) = self.centres.tolist()
        alpha, beta = (x_cw + x_ccw) / (-4.0 * SIDE), (x_cw - x_ccw) / (-4.0 * SIDE)
        ratio = 1.0
        if beta != 0.0:
            radius = 0.5 * SIDE / math.sin(0.5 * beta)
            ratio = (radius + 0.5 * TRACK) / (radius - 0.5 * TRACK)
        return 0.5 * math.pi / (0.5 * math.pi - alpha), ratio


def square(direction: float) -> Float:
    """(n, 2) true rim travel m, left and right, along a square; ``direction`` 1 to the left."""
    straight = round(SIDE / SPEED * RATE)
    corner = round(0.5 * math.pi / TURNING * RATE)
    half = 0.25 * math.pi * TRACK / corner
    leg = np.full((straight, 2), SIDE / straight)
    turn = np.tile((-direction * half, direction * half), (corner, 1))
    return np.cumsum(np.concatenate([leg, turn] * 4), axis=0)


def drive(
    config: OdometryConfig | str, errors: tuple[float, float, float] | None, seed: int, way: float
) -> Float:
    """(2,) true minus reported end of one run, m."""
    odometry = WheelOdometry(config, np.random.default_rng(seed), track=TRACK, errors=errors)
    for rims in square(way):
        odometry.update(rims)
    return -odometry.pose[:2]


def measure_unit(config: OdometryConfig | str, seed: int, runs: int = RUNS) -> Unit:
    """Drive one robot round the square, ``runs`` times each way."""
    errors = WheelOdometry(config, np.random.default_rng(seed), track=TRACK).errors
    ends = [
        [drive(config, errors, 10_000 * seed + k, way) for k in range(first, first + runs)]
        for first, way in ((1, 1.0), (5_001, -1.0))
    ]
    return Unit(errors=errors, ends=np.array(ends))


def figure(units: Sequence[Unit]) -> Figure:
    """End errors of some robots: clouds are random, their distance from (0, 0) is systematic."""
    out = Figure(figsize=(9.0, 2.7), layout="constrained")
    for ax, unit in zip(out.subplots(1, len(units), sharex=True, sharey=True), units, strict=True):
        for ends, color, name in zip(
            unit.ends, (BLUE, RED), ("to the left", "to the right"), strict=True
        ):
            ax.plot(*(1e3 * ends.T), ".", ms=7, color=color, alpha=0.6, label=f"squares {name}")
            ax.plot(*(1e3 * ends.mean(axis=0)), "+", ms=13, mew=2, color=color)
        ax.plot(0, 0, "o", ms=5, mfc="none", color=INK)
        scale, track, ratio = unit.errors
        ax.set_title(f"Eb {track:.3f}   Ed {ratio:.4f}   Es {scale:.3f}", fontsize=9)
        ax.set_xlabel("x error [mm]", fontsize=8)
        ax.tick_params(labelsize=8)
        ax.set_aspect("equal")
        ax.grid(alpha=0.3)
    out.axes[0].set_ylabel("y error [mm]", fontsize=8)
    out.axes[0].legend(fontsize=8, loc="best")
    return out


def tables(units: Sequence[Unit]) -> str:
    """What stands on the page between its marks."""
    robots = []
    for k, unit in enumerate(units):
        (_, track, ratio), (eb, ed) = unit.errors, unit.estimate
        numbers = (f"{number:.4f}" for number in (track, eb, ratio, ed))
        robots.append([str(k + 1), *numbers, f"{1e3 * unit.worst:.0f} mm"])
    presets = []
    for name in PRESETS:
        many = [measure_unit(name, seed) for seed in range(ROBOTS)]
        worst = float(np.median([u.worst for u in many]))
        spread = float(np.median([u.ends.std(axis=1).mean() for u in many]))
        presets.append([f"`{name}`", f"{1e3 * worst:.0f} mm", f"{1e3 * spread:.0f} mm"])
    told = f"Median over {ROBOTS} robots of each preset, five squares each way:"
    return "\n\n".join((table(HEADS, robots), told, table(PRESET_HEADS, presets)))


def main() -> None:
    """Fill in the page, draw its picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=Path("docs"))
    out = parser.parse_args().out
    (out / "pictures").mkdir(parents=True, exist_ok=True)
    robots = sorted((measure_unit("pioneer3dx", k) for k in range(ROBOTS)), key=lambda u: u.worst)
    units = [robots[round(ROBOTS * part)] for part in (0.25, 0.5, 0.75)]
    save(figure(units), out / "pictures" / "umbmark.png")
    fill_page(out / "odometry.md", "umbmark", tables(units))
    print(f"wrote {out / 'odometry.md'}")


if __name__ == "__main__":
    main()
