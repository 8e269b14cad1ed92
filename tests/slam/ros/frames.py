# SPDX-License-Identifier: Apache-2.0
"""A drive along a wall, as frames: what the network is tried with."""

from collections import defaultdict

import numpy as np

from slam import se2
from slam.frames import Frame, LaserSpec, Odometry, Scan
from slam.ros.link import Taken, Topic

SPEC = LaserSpec(
    n_beams=361, angle_min=-np.pi / 2, angle_increment=np.pi / 360, range_min=0.0, range_max=80.0
)
STEP_NS = 26_666_667


def driven(n: int) -> list[Frame]:
    """n frames of a robot that drives a circle; each scan has other ranges, some of them inf."""
    frames, covariance = [], np.diag([1e-6, 2e-6, 3e-6])
    for k in range(n):
        stamp_ns, turn = (k + 1) * STEP_NS, 0.002 * k
        ranges = (2.0 + np.sin(np.arange(361) * 0.05 + 0.1 * k)).astype(np.float32)
        ranges[k % 361] = np.inf
        pose = np.array([2.0 * np.sin(turn), 2.0 - 2.0 * np.cos(turn), turn])
        odometry = Odometry(stamp_ns=stamp_ns, T_odom_robot=pose, increment_covariance=covariance)
        scan = Scan(stamp_ns=stamp_ns, ranges=ranges, spec=SPEC)
        truth = se2.compose(np.ones(3), pose)  # odometry is perfect
        frames.append(Frame(stamp_ns=stamp_ns, odometry=odometry, scan=scan, truth=truth))
    return frames


class InMemory:
    """A link to nobody: what a test puts in, by name or topic, is taken."""

    def __init__(self) -> None:
        self.sent: dict[str, list[bytes]] = defaultdict(list)
        self.come: dict[str | Topic, list[Taken]] = defaultdict(list)

    def advertise(self, topic: Topic) -> None:
        self.sent[topic.name]

    def subscribe(self, topic: Topic) -> None:
        self.come[topic.name]

    def publish(self, topic: Topic, data: bytes) -> None:
        self.sent[topic.name].append(data)

    def take(self, topic: Topic) -> list[Taken]:
        return self.come.pop(topic, []) or self.come.pop(topic.name, [])
