# SPDX-License-Identifier: Apache-2.0
"""A bag of a robot with a scanner ahead and one behind."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

import tests.slam.logs.foreign_bags as bags
from tests.world2d import Drive, World2D, arena, frames, laser

TURNED = (0.0, 0.0, 1.0, 0.0)
MOUNTS = {"front": (0.3, 0.0, 0.0), "rear": (-0.3, 0.0, math.pi)}
WAY = Drive((0.0, 0.0, 0.0), ((0.4, 0.4, 8.0), (0.4, -0.4, 8.0)))


def bag(path: Path, *, apart_s: float = 0.05, late_ns: int = 0, transforms: bool = True) -> Path:
    """A drive with a scanner ahead and one behind; that one's messages are logged late."""
    make, first = bags.Maker(), bags.START_NS
    out = []
    if transforms:
        for name, (x, y, yaw) in MOUNTS.items():
            flat = TURNED if yaw else (0.0, 0.0, 0.0, 1.0)
            out.append(make.transform(first, "base_link", name, (x, y, 0.0), flat))
    specs = [
        replace(laser(n), T_robot_laser=np.array(mount))
        for n, mount in zip((91, 61), MOUNTS.values(), strict=True)
    ]
    driven = frames(World2D(arena()), WAY, rate_hz=5.0, spec=specs, apart_s=apart_s, seed=4)
    for k, frame in enumerate(driven):
        name, stamp = ("front", "rear")[k % 2], first + frame.stamp_ns
        if k == 0 or frame.stamp_ns > driven[k - 1].stamp_ns:
            out.append(make.odometry(stamp, frame.odometry.T_odom_robot))
        spec = frame.scan.spec
        topic, kind, _, message = make.scan(
            stamp, frame.scan.ranges, topic=f"/{name}", header=make.header(stamp, name),
            angle_min=spec.angle_min, angle_increment=spec.angle_increment,
        )  # fmt: skip
        out.append((topic, kind, stamp + late_ns * (k % 2), message))
    return bags.write_ros2(path, sorted(out, key=lambda one: one[2]), "mcap")
