# SPDX-License-Identifier: Apache-2.0
"""The frames of /tf: the way from one to another, the scanner's place, odometry that is only there.

Links are (parent, child) -> geometry_msgs/Transform. A step is a link and whether it is walked up.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float
from slam.logs.bag_laser import Stamped, stamp_of
from slam.logs.ros_numbers import planar, yaw_of

MOST_TRANSFORMS = 2000  # between frames; of a robot with arms, 200
BASES = ("base_footprint", "base_link")  # of REP 105 and 120
FIXED = ("odom", "map", "world", "earth")  # in the name of a frame that does not ride on the robot
Edge = tuple[str, str]
Step = tuple[Edge, bool]
Links = Mapping[Edge, Any]
Matrix = list[list[float]]


def frame_name(name: str) -> str:
    """Without the leading slash of ROS 1."""
    return name.lstrip("/")


def edge_of(link: Any) -> Edge:
    """Of a geometry_msgs/TransformStamped."""
    return frame_name(link.header.frame_id), frame_name(link.child_frame_id)


def check_number(links: Links) -> None:
    """``InvalidValueError`` for more than ``MOST_TRANSFORMS``."""
    if len(links) > MOST_TRANSFORMS:
        raise InvalidValueError(f"more than {MOST_TRANSFORMS} transforms between frames")


def _last(frame: str) -> str:
    return frame.rpartition("/")[2].lower()


def of_another(frame: str, other: str) -> bool:
    """Whether two frames say that they are of two robots: robot0/laser and robot1/base_link."""
    mine, theirs = frame.rpartition("/")[0], other.rpartition("/")[0]
    return bool(mine and theirs) and mine != theirs


def stands(frame: str) -> bool:
    """Whether a frame does not ride on the robot, by its name."""
    return any(name in _last(frame) for name in FIXED)


def way(links: Links, start: str, goal: str, *, up: bool = True, fixed: bool = False) -> list[Step]:
    """The steps from ``start`` to ``goal``; [] without a way.

    up     links may be walked from child to parent
    fixed  the way may lead through frames that do not ride on the robot; there, two robots meet
    """
    return _steps(_reached(_neighbours(links, up), start, goal, shut=up and not fixed), start, goal)


Neighbours = Mapping[str, Sequence[tuple[str, Step]]]
Reached = Mapping[str, tuple[str, Step]]


def _neighbours(links: Links, up: bool = True) -> Neighbours:
    near = defaultdict[str, list[tuple[str, Step]]](list)
    for parent, child in links:
        near[parent].append((child, ((parent, child), False)))
        if up:
            near[child].append((parent, ((parent, child), True)))
    return near


def _reached(near: Neighbours, start: str, goal: str = "", *, shut: bool = True) -> Reached:
    """Of each frame that is reached, the nearest first: from which, and by which step.

    shut  those that do not ride on the robot are closed, but for ``goal``
    """
    came: dict[str, tuple[str, Step]] = {}
    rim = [start]
    for here in rim:
        for there, step in near.get(here, ()):
            if there in came or there == start or (shut and there != goal and stands(there)):
                continue
            came[there] = here, step
            rim.append(there)
    return came


def _steps(came: Reached, start: str, goal: str) -> list[Step]:
    if goal not in came:
        return []
    steps = []
    while goal != start:
        goal, step = came[goal]
        steps.append(step)
    return steps[::-1]


def bases(links: Links, laser: str) -> list[str]:
    """Frames with the name of a robot's base, none of another robot than the scanner's."""
    frames = {frame for edge in links for frame in edge}
    found = [f for f in frames if _last(f) in BASES and not of_another(f, laser)]
    return sorted(found, key=lambda f: (_last(f) != "base_link", f))


def robot_of(links: Links, child: str, laser: str) -> str:
    """The frame that moves: ``child`` of odometry, or a base where no way leads from there."""
    for name in (child, *bases(links, laser)):
        if name and (name == laser or way(links, name, laser)):
            return name
    return child or "base_link"


def odometry_way(links: Links, laser: str, frame: str = "") -> list[Step]:
    """The steps from a frame of odometry to the robot's: from ``frame``, or by its name.

    A way that goes on to the scanner is preferred, then the shortest. [] without one.
    """
    starts = {f for edge in links for f in edge if "odom" in _last(f)} if not frame else {frame}
    found, near, goals = [], _neighbours(links), bases(links, laser)
    for odom in (start for start in starts if not of_another(start, laser)):
        came = _reached(near, odom, laser)
        ahead = _steps(came, odom, laser)
        ways = [] if ahead else [_steps(came, odom, goal) for goal in goals if goal in came]
        steps = ahead or min(ways, key=len, default=[])
        if steps:
            rank = (not ahead, _last(odom) != "odom", len(steps), odom)
            found.append((rank, _to_base(steps)))
    return min(found)[1] if found else []


def _to_base(steps: list[Step]) -> list[Step]:
    """Up to the robot's base: the first frame of that name, else the first of all."""
    ends = [_last(ends_at(steps[: k + 1])) for k in range(len(steps))]
    return steps[: next((k for k, end in enumerate(ends) if end in BASES), 0) + 1]


def planar_of(moved: Any) -> Float:
    """(3,) m, m, rad of a geometry_msgs/Transform."""
    return planar(SimpleNamespace(position=moved.translation, orientation=moved.rotation))


def ends_at(steps: Sequence[Step]) -> str:
    """The frame to which they lead."""
    (parent, child), up = steps[-1]
    return parent if up else child


def begins_at(steps: Sequence[Step]) -> str:
    """The frame from which they lead."""
    (parent, child), up = steps[0]
    return child if up else parent


class Chain:
    """The transform along a way, of the newest of each of its links.

    stamp  which of their times it has: ``max``, or ``min`` where all of them must be as new
    """

    def __init__(self, steps: Sequence[Step], stamp: Callable[[Iterable[int]], int] = max) -> None:
        self.steps, self._stamp = steps, stamp
        self._newest: dict[Edge, Stamped] = {}
        self._moving: set[Edge] = set()
        self._static: set[Edge] = set()

    def newest(self, topic: str, message: Any, log_ns: int) -> Stamped | None:
        """With this tf2_msgs/TFMessage; None where it says nothing new, or not all is known."""
        edges = {edge for edge, _ in self.steps}
        moved = [link for link in message.transforms if edge_of(link) in edges]
        for link in moved:
            edge, pose = edge_of(link), planar_of(link.transform)
            if edge in self._newest and not np.array_equal(self._newest[edge].pose, pose):
                self._moving.add(edge)
            if topic.endswith("tf_static"):
                self._static.add(edge)
            self._newest[edge] = Stamped(stamp_of(link, log_ns), pose)
        if not moved or len(self._newest) < len(edges):
            return None
        T_start_end: Float = np.zeros(3)
        for edge, up in self.steps:
            step = self._newest[edge].pose
            T_start_end = se2.compose(T_start_end, se2.inverse(step) if up else step)
        timed = self._moving or edges - self._static or edges
        return Stamped(self._stamp(self._newest[edge].stamp_ns for edge in timed), T_start_end)


def mounting(transforms: Links, robot: str, laser: str) -> tuple[Float, bool] | None:
    """``T_robot_laser`` and whether the laser hangs upside down; None without a way to it.

    Raises ``InvalidValueError`` for more than ``MOST_TRANSFORMS``.
    """
    check_number(transforms)
    steps = way(transforms, robot, laser, up=False) or way(transforms, robot, laser)
    if not steps:
        return None
    chain = [_inverse(transforms[edge]) if up else transforms[edge] for edge, up in steps]
    chain = [link for link in chain if not _is_identity(link)] or chain[:1]
    if len(chain) == 1:
        t, q = chain[0].translation, chain[0].rotation
        if q.x == 0.0 and q.y == 0.0:
            return np.array([t.x, t.y, yaw_of(q.x, q.y, q.z, q.w)]), False
    turn: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    at = [0.0, 0.0, 0.0]
    for link in chain:
        t = (link.translation.x, link.translation.y, link.translation.z)
        at = [at[i] + sum(turn[i][k] * t[k] for k in range(3)) for i in range(3)]
        step = _matrix(link.rotation)
        turn = [
            [sum(turn[i][k] * step[k][j] for k in range(3)) for j in range(3)] for i in range(3)
        ]
    yaw = math.atan2(turn[1][0], turn[0][0])
    return np.array([at[0], at[1], yaw]), turn[2][2] < 0.0


def _is_identity(link: Any) -> bool:
    t, q = link.translation, link.rotation
    return (t.x, t.y, t.z, q.x, q.y, q.z, q.w) == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def _matrix(q: Any) -> Matrix:
    x, y, z, w = q.x, q.y, q.z, q.w
    norm = x * x + y * y + z * z + w * w
    if not (math.isfinite(norm) and norm > 1e-12):
        raise InvalidValueError("a transform with a quaternion of length zero")
    s = 2.0 / norm
    return [
        [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
    ]


def _inverse(link: Any) -> Any:
    """The transform from its child to its parent."""
    turn, q = _matrix(link.rotation), link.rotation
    t = (link.translation.x, link.translation.y, link.translation.z)
    x, y, z = (-sum(turn[k][i] * t[k] for k in range(3)) for i in range(3))
    return SimpleNamespace(
        translation=SimpleNamespace(x=x, y=y, z=z),
        rotation=SimpleNamespace(x=-q.x, y=-q.y, z=-q.z, w=q.w),
    )
