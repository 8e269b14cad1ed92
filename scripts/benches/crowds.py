# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench`` about crowds: what generation and scans cost as movers grow."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from scripts.benches.dataset import written
from scripts.benches.world import SEED, Row, row, scan_us
from sim.core.dynamism import Dynamism
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation
from sim.world.world import World

WORLD_1 = Dynamism.world_1(0.5)
# What, scene, what a simulation is made with, target x real time.
CASES: tuple[tuple[str, str, dict[str, Any], str], ...] = (
    ("office, 0.5 of world 1", "office", {"dynamism": WORLD_1, "crowd": "none"}, "≥ 15"),
    ("office, motion 0.5", "office", {"dynamism": 0.0, "motion": 0.5}, "≥ 15"),
    ("office, 16 escorts", "office", {"dynamism": WORLD_1, "crowd": "escorts:16"}, "≥ 6"),
    ("station, motion 1", "station", {"dynamism": 0.0, "motion": 1.0}, "≥ 3"),
)
EMPTY: dict[str, Any] = {"n_people": 0, "n_chairs": 0, "n_trolleys": 0}
STREAMS = (10, 20, 40, 80)  # of the scans; each twice the one before
TWICE = 2.0  # a cost that grows with the number at most doubles with it


def rows(seconds: float) -> Iterator[Row]:
    """Episodes made and written, with labels and every effect; then scans."""
    for what, scene, settings, target in CASES:
        simulation = Simulation(scene, seed=SEED, labels=True, **settings)
        people = len(simulation.world.people.names)
        with tempfile.TemporaryDirectory() as scratch:
            made, _, _ = written(simulation, seconds, Path(scratch))
        how = f"simulated and written, labels, {people} people"
        yield row(f"episode, made, {what}", seconds / made, "× real time", target, how)
    yield from scans(seconds)


def scans(seconds: float) -> Iterator[Row]:
    """A scan in a station at rest against the number of people in it."""
    costs = {}
    for n in STREAMS:
        world = World("station", seed=SEED, dynamism=0.0, crowd=f"streams:{n}", **EMPTY)
        costs[n] = scan_us(world, Lms221Config(), max(20, round(5 * seconds)))
        how = "station at rest, 361 beams, every effect"
        yield row(f"scan, {n} people", costs[n], "µs", "", how)
    worst = max(costs[2 * n] / costs[n] for n in STREAMS[:-1])
    how = f"the most of {', '.join(map(str, STREAMS[:-1]))}; at most linear in their number"
    yield row("scan, twice the people", worst, "× as much", f"≤ {TWICE:g}", how)
