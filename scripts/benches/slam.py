# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench`` about the SLAM: updates, memory, maps of ever more rooms."""

import dataclasses
import math
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from scripts.benches.world import DYNAMISM, SEED, Row, row, timed
from sim.simulation import stream
from slam.ekf.slam import EkfSlam
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.cells import living
from slam.tracker.map_file import fill


def updates(seconds: float) -> Iterator[Row]:
    """Time of a scan, and bytes of a neuron."""
    frames = list(stream("office", seed=SEED, dynamism=DYNAMISM, seconds=seconds + 2.0))
    blind = [frame.without_truth() for frame in frames]
    coarse = ShuntingConfig(cell_m=0.05)
    for what, stride, config, stream_, targets in (
        ("shunting, 37.5 Hz", 1, ShuntingConfig(), blind, ("≤ 3, aim 1", "")),
        ("shunting, 4.7 Hz", 8, ShuntingConfig(), blind, ("≤ 3, aim 1", "≥ 100")),
        ("shunting, 5 cm cells, 181 beams", 1, coarse, _halved(blind), ("aim 0.5", "")),
    ):
        slam = ShuntingSlam(config)
        spent = [timed(partial(slam.update, frame)) for frame in stream_[::stride]]
        steady = np.array(spent[5:]) * 1e3
        how = "office, every effect; 361 beams and 3 cm cells unless said otherwise"
        yield row(f"{what}, p50", float(np.percentile(steady, 50)), "ms", targets[0], how)
        yield row(f"{what}, p99", float(np.percentile(steady, 99)), "ms", "", how)
        period_ms = 1e3 * stride / 37.5
        yield row(what, period_ms / float(steady.mean()), "× real time", targets[1], how)
        if stride == 1 and config != coarse:
            memory, how = slam.network.bytes_per_neuron(), "office, every array, at the end"
            yield row("network", memory, "B a live neuron", "≤ 40", how)


def _halved(frames: list[Any]) -> list[Any]:
    """Every second beam of each scan."""
    spec = frames[0].scan.spec
    half = dataclasses.replace(
        spec,
        n_beams=(spec.n_beams + 1) // 2,
        angle_increment=2.0 * spec.angle_increment,
        beam_time_offsets=spec.beam_time_offsets[::2],
    )
    scans = [dataclasses.replace(f.scan, ranges=f.scan.ranges[::2], spec=half) for f in frames]
    return [dataclasses.replace(f, scan=s) for f, s in zip(frames, scans, strict=True)]


def ekf(seconds: float) -> Iterator[Row]:
    """A step of the EKF when it knows 300 landmarks and sees so many of them."""
    for in_view, n_points, side_m, n_steps in ((20, 338, 60.0, 340), (45, 302, 36.0, 240)):
        config = PointWorldConfig(n_points=n_points, side_m=side_m, n_steps=n_steps)
        frames = [frame.without_truth() for frame in PointWorld(config, seed=SEED).stream()]
        slam, last = EkfSlam(), min(max(20, round(2 * seconds)), n_steps // 3)
        spent = [timed(partial(slam.update, frame)) for frame in frames][-last:]
        seen = np.mean([len(f.features.points_robot) for f in frames[-last:] if f.features])
        how = f"{seen:.0f} points in view, {len(slam.filter)} landmarks in the end, IPJC"
        for name, percent, target in (("p50", 50, "≤ 10"), ("p90", 90, "")):
            figure = float(np.percentile(spent, percent)) * 1e3
            yield row(f"EKF, 300 landmarks, {in_view} in view, {name}", figure, "ms", target, how)


def area(seconds: float) -> Iterator[Row]:
    """One scan in a map of ever more rooms like the one the robot is in."""
    slam = ShuntingSlam(ShuntingConfig(cell_m=0.05))
    frames = list(stream("arena", seed=SEED, dynamism=DYNAMISM, seconds=seconds / 2.0 + 8.0))
    for frame in frames[:-150]:
        slam.update(frame.without_truth())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arena.npz"
        slam.save(path)
        for times in (1, 10, 100, 1000):
            slam = ShuntingSlam.load(path)
            enlarge(slam.network, times)
            yield _in_area(slam, frames[-150:], times)


def _in_area(slam: Any, frames: list[Any], times: int) -> Row:
    spent = [timed(partial(slam.update, frame.without_truth())) for frame in frames]
    extent = slam.network.extent()
    square_m = (extent[2] - extent[0]) * (extent[3] - extent[1]) * 0.05**2
    how = f"median of 150 scans, arena, 5 cm cells, {times} × the rooms"
    what = f"shunting in a map of {square_m:.3g} m²"
    return row(what, float(np.median(spent)) * 1e3, "ms", "flat within 20 %", how)


def enlarge(network: Any, times: int) -> None:
    """Let copies of all that lives be there ``times`` times, in a square beside itself."""
    slots, places = living(network.cells)
    side = places.max(axis=0) - places.min(axis=0) + 9
    across = math.ceil(math.sqrt(times))
    for k in range(1, times):
        arrays = {n: getattr(network.cells, n)[slots] for n in ("x", "y", "age", "facing")}
        fill(network, arrays | {"places": places + side * (k % across, k // across)})
