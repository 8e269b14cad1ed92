# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench`` about episodes: making, reading, sizes, and what crowds cost."""

import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from scripts.benches.world import DYNAMISM, SEED, Row, row, scan_us
from sim.core.dynamism import Dynamism
from sim.moments import toured
from sim.recording.bag import BagWriter
from sim.recording.recipe import Recipe
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.simulation import Simulation, n_frames
from sim.world.world import World
from slam.logs import read_bag

WARM_S = 2.0
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


def office(seconds: float) -> Iterator[Row]:
    """Office, half-degree scans at 37.5 Hz, every effect, labels."""
    recipe = Recipe(scene="office", seed=SEED, dynamism=DYNAMISM, seconds=seconds)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        made, writing, bag = written(Simulation(**recipe.simulation()), seconds, folder)
        frames = n_frames(seconds, 1.0 / 37.5)
        yield row("episode, made", seconds / made, "× real time", "≥ 15", "simulate and write")
        share = 100.0 * writing / made
        yield row("episode, share of writing", share, "%", "", "of processor time")
        size = sum(file.stat().st_size for file in bag.iterdir())
        raw = 4 * recipe.laser().spec().n_beams
        per_frame = size / (frames + n_frames(WARM_S, 1.0 / 37.5))
        yield row("episode, bytes a frame", per_frame, "B", "", f"ranges as float32: {raw} B")
        for what, labels, target in (("", False, "≥ 8000"), (", with labels", True, "")):
            rate = _reading(bag, labels)
            yield row(f"bag, read{what}", rate, "frames/s", target, "into Frames")


def written(simulation: Simulation, seconds: float, folder: Path) -> tuple[float, float, Path]:
    """Processor seconds of all after a warm-up, and of writing among them; the bag."""
    moments, writing = toured(simulation, seconds + WARM_S), 0.0
    with BagWriter(folder / "bag", simulation.spec, movers=simulation.world.scene.movers) as bag:
        for moment in islice(moments, n_frames(WARM_S, simulation.scan_period_s)):
            bag.write(moment)
        started = time.process_time()
        for moment in moments:
            begun = time.process_time()
            bag.write(moment)
            writing += time.process_time() - begun
        made = time.process_time() - started
    return made, writing, folder / "bag"


def _reading(bag: Path, labels: bool) -> float:
    stream = read_bag(bag, labels=labels)
    next(iter(stream))
    started = time.process_time()
    count = sum(1 for _ in stream)
    return count / (time.process_time() - started)


def crowds(seconds: float) -> Iterator[Row]:
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
