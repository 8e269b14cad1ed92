# SPDX-License-Identifier: Apache-2.0
"""World + scanner + encoders + ceiling tags = frames, the same for every listener."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from sim.contacts import Contact
from sim.drive import TourConfig
from sim.dynamism import Dynamism
from sim.labels import BeamLabeller
from sim.lidar import Lms221, Lms221Config
from sim.odometry import WheelOdometry
from sim.pilot import Pilot
from sim.robot import DriveConfig
from sim.seeds import Seeds
from sim.world import SUBSTEPS_PER_S, World
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Frame, LaserSpec, Scan, Stream, StreamMetadata


class Simulation:
    """A world seen by its robot: each ``observe`` is one whole scan and the frame it makes.

    scene      name of a registered scene, or ``module:function``
    seed       whole number or ``Seeds``; every part draws from its own stream
    dynamism   0 (nothing moves) to 1, or the rates themselves
    laser      how the scanner is set; default ``Lms221Config()``
    odometry   preset of the wheel encoders: "pioneer3dx", "probabilistic_robotics", "ideal"
    drive      limits of the robot
    labels     whether frames carry truth per beam
    options    passed on to the scene, e.g. ``n_chairs=10``
    """

    def __init__(
        self,
        scene: str = "office",
        *,
        seed: int | Seeds = 0,
        dynamism: float | Dynamism = 0.5,
        laser: Lms221Config | None = None,
        odometry: str = "pioneer3dx",
        drive: DriveConfig | None = None,
        labels: bool = False,
        **options: Any,
    ) -> None:
        drive = drive or DriveConfig()
        self.world = World(scene, seed=seed, dynamism=dynamism, drive=drive, **options)
        self.odometry_preset = odometry
        seeds = self.world.seeds
        self.laser = Lms221(self.world.model, laser, seeds.generator("lidar"))
        self.encoders = WheelOdometry(odometry, seeds.generator("odometry"), track=drive.track)
        self._labeller = BeamLabeller(self.world) if labels else None
        self.frame: Frame | None = None  # the last one observed
        self.contacts: list[Contact] = []  # what the robot touched during the last scan
        self._travel: list[Float] = []
        self._poses: list[Float] = []

    @property
    def spec(self) -> LaserSpec:
        """Geometry and timing of the scanner, as in every frame's scan."""
        return self.laser.spec

    @property
    def scan_period_s(self) -> float:
        """Seconds of simulated time that one ``observe`` takes."""
        return self.laser.config.steps / SUBSTEPS_PER_S

    def _advance(self) -> None:
        self.world.substep()
        self._note()

    def _note(self) -> None:
        self._travel.append(self.world.wheel_angles())
        self._poses.append(self.world.robot_pose())

    def observe(self) -> Frame:
        """Let one scan's worth of time pass under the present command; the frame it gives.

        The frame's stamp is that of the earliest beam, so its odometry and truth lie one scan
        period before the world's present: nobody can know a scan before it is over.
        """
        config = self.laser.config
        start_ns = self.world.time_ns
        self._travel, self._poses = [], []
        self._note()
        result = self.laser.observe(self._advance, self.world.data)
        stamp_ns = start_ns + config.stamp_offset_ns
        first = config.stamp_offset_ns * 1e-9 * SUBSTEPS_PER_S
        last = first + self.spec.sweep_duration * SUBSTEPS_PER_S
        self.contacts = self.world.take_contacts()
        touched = bool(self.contacts)
        self.encoders.begin_scan(self._travel_at(first), contact=touched)
        odometry = self.encoders.end_scan(
            self._travel_at(last),
            stamp_ns=stamp_ns,
            sweep_s=self.spec.sweep_duration,
            contact=touched,
        )
        self.frame = Frame(
            stamp_ns=stamp_ns,
            odometry=odometry,
            scan=Scan(stamp_ns=stamp_ns, ranges=result.ranges, spec=self.spec),
            truth=self._pose_at(first),
            labels=self._labeller.label(result) if self._labeller else None,
        )
        return self.frame

    def _travel_at(self, step: float) -> Float:
        """(2,) m rolled by the wheels, ``step`` physics steps after the scan's start."""
        k = min(int(step), len(self._travel) - 2)
        return self._travel[k] + (step - k) * (self._travel[k + 1] - self._travel[k])

    def _pose_at(self, step: float) -> Float:
        k = min(int(step), len(self._poses) - 2)
        if step == k:
            x, y, theta = self._poses[k].tolist()
            return np.array([x, y, se2.wrap(theta)])
        return se2.interpolate(self._poses[k], self._poses[k + 1], step - k)

    def metadata(self) -> StreamMetadata:
        """What a recording says about itself."""
        return StreamMetadata(
            source="simulation",
            scene=self.world.scene.name,
            seed=self.world.seeds.seed,
            laser=self.spec,
            robot=self.odometry_preset,
            truth="simulator",
            extra={"laser": asdict(self.laser.config), "dynamism": asdict(self.world.rates)},
        )


def tour(
    simulation: Simulation, seconds: float, config: TourConfig | None = None
) -> Iterator[Frame]:
    """Frames of ``seconds`` of driving round the scene's goals, avoiding what truly is there."""
    pilot = Pilot(simulation.world, config)
    for _ in range(n_frames(seconds, simulation.scan_period_s)):
        simulation.world.set_command(*pilot.command(simulation.scan_period_s))
        yield simulation.observe()


def n_frames(seconds: float, period_s: float) -> int:
    """Whole scans in ``seconds``."""
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise InvalidValueError(f"seconds must be > 0 and finite, got {seconds}")
    return max(1, round(seconds / period_s))


def stream(scene: str = "office", *, seconds: float = 60.0, **settings: Any) -> Stream:
    """A stream that simulates a tour anew each time it is iterated, byte for byte the same.

    settings  as for ``Simulation``
    """
    probe = Simulation(scene, **settings)
    return Stream(
        metadata=probe.metadata(),
        frames=lambda: tour(Simulation(scene, **settings), seconds),
        length=n_frames(seconds, probe.scan_period_s),
    )
