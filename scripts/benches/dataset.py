# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench`` about datasets: making, reading, sizes."""

import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from scripts.benches.world import Row, row
from sim.moments import toured
from sim.recording.bag import BagWriter
from sim.recording.recipe import Recipe
from sim.simulation import Simulation, n_frames
from slam.logs import read_bag

WARM_S = 2.0


def rows(seconds: float, *, seed: int, dynamism: float) -> Iterator[Row]:
    """Office, half-degree scans at 37.5 Hz, every effect, labels."""
    recipe = Recipe(scene="office", seed=seed, dynamism=dynamism, seconds=seconds)
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
