# SPDX-License-Identifier: Apache-2.0
"""Scans of ours to set beside those of a real log: driven, and standing at random places."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sim.driving.pilot import Pilot
from sim.gym.goals import Ground
from sim.sensors.lidar.receiver import ScanResult
from sim.sensors.lidar.registry import ScannerConfig
from sim.simulation import Simulation, n_frames
from slam.frames import Frame, LaserSpec, Odometry, Stream, StreamMetadata

SCENES = ("corridor", "office", "classroom", "gallery")
SEED = 18
PLACES = 12  # a scene, where the robot stands
STANDING = 16  # scans at each
DRIVEN_S = 20.0  # s of a tour of each scene
RATE_HZ = 5.0  # of the scans of the tour that are used, as real logs have


@dataclass(frozen=True, kw_only=True)
class Simulated:
    """``stream``: everything at rest but the robot; ``mixed``: truth, (n,) a scan of it."""

    stream: Stream
    mixed: list[NDArray[np.bool_]] = field(default_factory=list)


def simulated(
    scanner: ScannerConfig, *, scenes: tuple[str, ...] = SCENES, places: int = PLACES,
    driven_s: float = DRIVEN_S,
) -> Simulated:  # fmt: skip
    """Scans of ``scanner`` in static scenes; the odometry of the frames is the truth."""
    frames: list[Frame] = []
    mixed: list[NDArray[np.bool_]] = []
    spec: LaserSpec | None = None
    for number, scene in enumerate(scenes):
        simulation = Simulation(
            scene, seed=SEED + number, dynamism=0.0, laser=scanner, odometry="ideal"
        )
        spec = spec or simulation.spec
        rng = np.random.default_rng([SEED, number])
        for result in _scans(simulation, rng, places, driven_s):
            frame = simulation.frame
            assert frame is not None
            assert frame.scan is not None
            assert frame.truth is not None
            wheels = Odometry(stamp_ns=frame.stamp_ns, T_odom_robot=frame.truth)
            frames.append(replace(frame, odometry=wheels, scan=replace(frame.scan, spec=spec)))
            mixed.append(result.mixed)
    metadata = StreamMetadata(source="simulation", laser=spec)
    stream = Stream(metadata=metadata, frames=lambda: frames, length=len(frames))
    return Simulated(stream=stream, mixed=mixed)


def _scans(
    simulation: Simulation, rng: np.random.Generator, places: int, driven_s: float
) -> Iterator[ScanResult]:
    """First the places, then the tour from where it began."""
    world, period_s = simulation.world, simulation.scan_period_s
    ground, start = Ground(world), world.robot_pose()
    for _ in range(places):
        x, y = ground.drawn(rng)
        world.carry((x, y, float(rng.uniform(-math.pi, math.pi))))
        simulation.sense()  # begun before the robot was carried
        for _ in range(STANDING):
            yield simulation.sense()
    world.carry(start)
    pilot, every = Pilot(world), max(1, round(1.0 / (RATE_HZ * period_s)))
    for number in range(n_frames(driven_s, period_s)):
        world.set_command(*pilot.command(period_s))
        result = simulation.sense()
        if number % every == 0:
            yield result
