# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench`` about crowds: what generation and scans cost as movers grow."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from scripts.benches.world import SEED, Row, median, note_poses, row
from sim.core.dynamism import Dynamism
from sim.moments import toured
from sim.recording.bag import BagWriter
from sim.sensors.lidar.device import LaserScanner
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation, n_frames
from sim.world.world import World

WARM_S = 2.0
WORLD_1 = Dynamism.world_1(0.5)
# What, scene, what a simulation is made with, target x real time.
CASES: tuple[tuple[str, str, dict[str, Any], str], ...] = (
    ("office, 0.5 of world 1", "office", {"dynamism": WORLD_1, "crowd": "none"}, "≥ 15"),
    ("office, motion 0.5", "office", {"dynamism": 0.0, "motion": 0.5}, "≥ 15"),
    ("office, 16 escorts", "office", {"dynamism": WORLD_1, "crowd": "escorts:16"}, "≥ 6"),
    ("station, motion 1", "station", {"dynamism": 0.0, "motion": 1.0}, "≥ 3"),
)
STREAMS = (10, 20, 40, 80)  # of the scans; each twice the one before
TWICE = 2.0  # a cost that grows with the number at most doubles with it


def rows(seconds: float) -> Iterator[Row]:
    """Episodes made and written, with labels and every effect; then scans."""
    for what, scene, settings, target in CASES:
        simulation = Simulation(scene, seed=SEED, labels=True, **settings)
        people = len(simulation.world.people.names)
        figure = seconds / _made(simulation, seconds)
        how = f"simulated and written, labels, {people} people"
        yield row(f"episode, made, {what}", figure, "× real time", target, how)
    yield from scans(seconds)


def _made(simulation: Simulation, seconds: float) -> float:
    """s of processor time, after a warm-up."""
    moments = toured(simulation, seconds + WARM_S)
    with tempfile.TemporaryDirectory() as scratch:
        movers = simulation.world.scene.movers
        with BagWriter(Path(scratch) / "bag", simulation.spec, movers=movers) as bag:
            for moment in islice(moments, n_frames(WARM_S, simulation.scan_period_s)):
                bag.write(moment)
            started = time.process_time()
            for moment in moments:
                bag.write(moment)
            return time.process_time() - started


def scans(seconds: float) -> Iterator[Row]:
    """A scan in a station at rest against the number of people in it."""
    costs = {}
    for n in STREAMS:
        options: dict[str, Any] = {
            "crowd": f"streams:{n}",
            "n_people": 0,
            "n_chairs": 0,
            "n_trolleys": 0,
        }
        world = World("station", seed=SEED, dynamism=0.0, **options)
        costs[n] = _scan_us(world, max(20, round(5 * seconds)))
        how = "station at rest, 361 beams, every effect"
        yield row(f"scan, {n} people", costs[n], "µs", "", how)
    worst = max(costs[2 * n] / costs[n] for n in STREAMS[:-1])
    how = f"the most of {', '.join(map(str, STREAMS[:-1]))}; at most linear in their number"
    yield row("scan, twice the people", worst, "× as much", f"≤ {TWICE:g}", how)


def _scan_us(world: World, count: int) -> float:
    laser = LaserScanner(world.model, Lms221Config(), np.random.default_rng(0))

    def many() -> None:
        for _ in range(count):
            note_poses(laser.begin(world.data), int(laser.window.marks[1:].sum()))
            laser.finish()

    many()
    return median(many) / count * 1e6
