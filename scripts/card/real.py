# SPDX-License-Identifier: Apache-2.0
"""Cards of real logs, and of scans of ours to set beside them: driven, and standing at random."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim.driving.pilot import Pilot
from sim.gym.goals import Ground
from sim.sensors.lidar.models.lms221 import SCAN_MODES
from sim.sensors.lidar.registry import DEFAULT, ScannerConfig, scanner_of
from sim.simulation import Simulation, n_frames
from slam.evaluation.scanner.card import ScannerCard, measure
from slam.frames import Frame, LaserSpec, Odometry, Stream, StreamMetadata
from slam.logs import open_log

SCENES = ("corridor", "office", "classroom", "gallery")
SEED = 18
PLACES = 12  # a scene, where the robot stands
STANDING = 16  # scans at each
DRIVEN_S = 20.0  # s of a tour of each scene
RATE_HZ = 5.0  # of the scans of the tour that are used, as real logs have


def real_card(
    logs: Sequence[Path], *, text_format: Path | None = None, strict: bool = False
) -> ScannerCard:
    """Of the logs of one scanner. Raises ``LogFormatError`` and what ``measure`` raises."""
    return measure(*(open_log(log, strict=strict, text_format=text_format) for log in logs))


def like(card: ScannerCard, scanner: str) -> str:
    """``scanner``, the default one with the log's angle between beams if it has such a mode."""
    if scanner != DEFAULT:
        return scanner
    degrees = math.degrees(card.increment_rad)
    mode = next((m for m in SCAN_MODES if math.isclose(m, degrees, rel_tol=0.01)), None)
    return scanner if mode is None else f"{scanner}(resolution_deg={mode:g})"


def simulated_card(scanner: str) -> ScannerCard:
    """Of a simulated scanner, by name, in static scenes."""
    return measure(simulated(scanner_of(scanner)))


def simulated(
    scanner: ScannerConfig, *, scenes: tuple[str, ...] = SCENES, places: int = PLACES,
    driven_s: float = DRIVEN_S,
) -> Stream:  # fmt: skip
    """Scans of ``scanner`` where all but the robot rests; the odometry of the frames is the truth.

    The robot stands at random ``places`` of each scene, and then drives.
    """
    frames: list[Frame] = []
    spec: LaserSpec | None = None
    for number, scene in enumerate(scenes):
        simulation = Simulation(
            scene, seed=SEED + number, dynamism=0.0, laser=scanner, odometry="ideal"
        )
        spec = spec or simulation.spec
        for frame in _scans(simulation, np.random.default_rng([SEED, number]), places, driven_s):
            assert frame.scan is not None
            assert frame.truth is not None
            wheels = Odometry(stamp_ns=frame.stamp_ns, T_odom_robot=frame.truth)
            frames.append(replace(frame, odometry=wheels, scan=replace(frame.scan, spec=spec)))
    metadata = StreamMetadata(source="simulation", laser=spec)
    return Stream(metadata=metadata, frames=lambda: frames, length=len(frames))


def _scans(
    simulation: Simulation, rng: np.random.Generator, places: int, driven_s: float
) -> Iterator[Frame]:
    """First the places, then the tour from where it began."""
    world, period_s = simulation.world, simulation.scan_period_s
    ground, start = Ground(world), world.robot_pose()
    for _ in range(places):
        x, y = ground.drawn(rng)
        world.carry((x, y, float(rng.uniform(-math.pi, math.pi))))
        simulation.sense()  # begun before the robot was carried
        for _ in range(STANDING):
            yield simulation.observe()
    world.carry(start)
    pilot, every = Pilot(world), max(1, round(1.0 / (RATE_HZ * period_s)))
    for number in range(n_frames(driven_s, period_s)):
        world.set_command(*pilot.command(period_s))
        frame = simulation.observe()
        if number % every == 0:
            yield frame
