# SPDX-License-Identifier: Apache-2.0
"""A log driven again in a built scene: its poses, its times, its scanner, odometry like its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Scene
from sim.core.dynamism import Dynamism
from sim.core.seeds import Seeds
from sim.sensors.lidar.device import LaserScanner
from sim.sensors.lidar.scanner import Band, Scanner
from sim.world.labels import BeamLabeller
from sim.world.world import SUBSTEPS_PER_S, SUBSTEPS_PER_TICK, World
from slam import se2
from slam.frames import NS_PER_S, Float, Frame, LaserSpec, Odometry, Scan

SWEEP_HZ = 75.0  # scans of a second: a mirror turn of a SICK LMS; the robot stands meanwhile
MOST_BETWEEN_S = 5.0  # that a room lives between two scans; a longer pause of a log is cut


def scanner_like(spec: LaserSpec, sigma_m: float, unit_m: float = 0.0) -> Scanner:
    """A scanner with the beams, field of view and range of a log, and that noise."""
    return Scanner(
        name="log",
        first_deg=math.degrees(spec.angle_min),
        step_deg=math.degrees(spec.angle_increment),
        n_beams=spec.n_beams,
        rate_hz=SWEEP_HZ,
        range_min_m=spec.range_min,
        range_max_m=min(spec.range_max, 1000.0),
        unit_m=unit_m,
        noise=(Band(up_to_m=1000.0, error_m=sigma_m),) if sigma_m > 0.0 else (),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """The way of a log: stamps ns, and (n, 3) poses and odometry in m, m, rad."""

    stamps_ns: NDArray[np.int64]
    poses: Float
    odometry: Float


class LogTwin:
    """A scene through which the robot is carried along the way of a log.

    scene     built, with its crowd if there is to be one
    spec      of the log's scans; scans here are as those, all beams at once
    rates     how much moves; None: nothing, and the scans are of the scene at rest
    """

    def __init__(
        self,
        scene: Scene,
        drive: Drive,
        spec: LaserSpec,
        scanner: Scanner,
        *,
        seed: int = 0,
        rates: Dynamism | None = None,
    ) -> None:
        seeds = Seeds(seed)
        self._lives = rates is not None
        self.world = World(scene, seed=seeds, dynamism=rates or 0.0)
        self._drive, self._spec = drive, spec
        self._robot = int(self.world.model.joint("robot/x").qposadr[0])
        self._speed = int(self.world.model.joint("robot/x").dofadr[0])
        model = self.world.model
        own = np.array(
            [model.body(b).name.startswith("robot/") for b in model.geom_bodyid.tolist()]
        )
        model.geom_contype[own] = model.geom_conaffinity[own] = 0  # it goes where the log went
        x, y, yaw = spec.T_robot_laser.tolist()
        site = model.site("robot/laser").id
        model.site_pos[site, :2] = x, y
        model.site_quat[site] = math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)
        self._laser = LaserScanner(model, scanner, seeds.generator("lidar"))
        self._labeller = BeamLabeller(self.world)

    def frames(self) -> Iterator[Frame]:
        """One for each scan of the log."""
        drive, before = self._drive, None
        for stamp_ns, pose, wheels in zip(
            drive.stamps_ns.tolist(), drive.poses, drive.odometry, strict=True
        ):
            if before is not None and self._lives:
                self._live(before[1], pose, (stamp_ns - before[0]) / NS_PER_S)
            before = (stamp_ns, pose)
            self._put(pose)
            result = self._laser.observe(lambda at=pose: self._put(at), self.world.data)  # type: ignore[misc]
            yield Frame(
                stamp_ns=stamp_ns,
                odometry=Odometry(stamp_ns=stamp_ns, T_odom_robot=wheels),
                scan=Scan(stamp_ns=stamp_ns, ranges=result.ranges, spec=self._spec),
                truth=se2.compose(pose, np.zeros(3)),
                labels=self._labeller.label(result),
            )

    def _put(self, pose: Sequence[float] | Float) -> None:
        data = self.world.data
        data.qpos[self._robot : self._robot + 3] = pose
        data.qvel[self._speed : self._speed + 3] = 0.0
        mujoco.mj_kinematics(self.world.model, data)

    def _live(self, first: Float, last: Float, seconds: float) -> None:
        """Let the room live while the robot is carried from pose to pose."""
        tick = SUBSTEPS_PER_TICK / SUBSTEPS_PER_S
        ticks = max(1, round(min(max(seconds, 0.0), MOST_BETWEEN_S) / tick))
        for k in range(ticks):
            self._put(se2.interpolate(first, last, (k + 1) / ticks))
            mujoco.mj_step1(self.world.model, self.world.data)
            for _ in range(SUBSTEPS_PER_TICK):
                self.world.substep()
