# SPDX-License-Identifier: Apache-2.0
"""Messages of the bag that only a simulation has: movers, truth per beam, topics of your own."""

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import kind_of
from scenes.scene import Mover
from sim.moments import Moment
from slam._jit import njit
from slam.errors import InvalidValueError, UnknownNameError
from slam.frames import BeamLabels, Float, LaserSpec, Scan
from slam.logs.bag_topics import LABELS
from slam.ros.frames import SCANS, STATE, scan_topics
from slam.ros.link import Topic
from slam.ros.messages import LASER, WORLD
from slam.ros.template import STORE, Marks, Template, header, message

LEAF_M = 0.04  # thickness of a door as drawn
_RESTING, _MOVING = (0.55, 0.55, 0.6, 1.0), (0.9, 0.3, 0.1, 1.0)
_CUBE, _CYLINDER = 1, 3


@njit
def _place(poses: Float, reach: Float, heights: Float, out: Float) -> None:
    """Position (m) and quaternion of each marker; a leaf's middle is ``reach`` off its hinge."""
    for k in range(len(poses)):
        yaw = poses[k, 2]
        out[k, 0] = poses[k, 0] + reach[k] * math.cos(yaw)
        out[k, 1] = poses[k, 1] + reach[k] * math.sin(yaw)
        out[k, 2] = 0.5 * heights[k]
        out[k, 5], out[k, 6] = math.sin(0.5 * yaw), math.cos(0.5 * yaw)


class ObjectsMessage:
    """One marker for each mover but the robot, always in the same order.

    ``ns`` its kind, ``id`` its place among the scene's movers, ``text`` its name, ``scale`` its
    size (m), ``color`` orange while it moves and grey while it rests.
    """

    KIND = "visualization_msgs/msg/MarkerArray"

    def __init__(self, movers: Sequence[Mover]) -> None:
        self._rows = [k for k, mover in enumerate(movers) if mover.group != "robot"]
        shown = [movers[k] for k in self._rows]
        marks, n = Marks(), len(shown)
        poses, colors = marks(7 * n).reshape(n, 7), marks(4 * n, np.float32).reshape(n, 4)
        self._heights = np.array([kind_of(mover.kind).height_m for mover in shown])
        self._reach = np.array([0.5 * m.radius if m.group == "door" else 0.0 for m in shown])
        markers = [
            _marker(mover, row, pose, color)
            for mover, row, pose, color in zip(shown, self._rows, poses, colors, strict=True)
        ]
        self._template = Template(self.KIND, message(self.KIND, markers=markers))
        self._poses, self._colors = self._template.index(poses), self._template.index(colors)
        self._placed = np.zeros((n, 7))
        self._palette = np.array([_RESTING, _MOVING], dtype=np.float32)

    def __call__(self, stamp_ns: int, all_poses: Float, moving: NDArray[np.bool_]) -> bytearray:
        """All markers as of that time; both arrays in the order of the scene's movers."""
        raw, rows = self._template.raw, self._rows
        if rows:
            _place(all_poses[rows], self._reach, self._heights, self._placed)
            raw[self._poses] = self._placed.view(np.uint8)
            colors = self._palette[moving[rows].astype(np.int64)]
            raw[self._colors] = colors.view(np.uint8)
        return self._template.stamp(stamp_ns)


def _marker(mover: Mover, row: int, pose: Float, color: NDArray[np.float32]) -> object:
    door, row_of = mover.group == "door", kind_of(mover.kind)
    height, half = row_of.height_m, row_of.half_length_m
    wide, deep = 2.0 * (half + mover.radius), 2.0 * mover.radius
    if door:
        wide, deep = mover.radius, LEAF_M
    return message(
        "visualization_msgs/msg/Marker",
        header=header(WORLD),
        ns=mover.kind,
        id=row,
        type=_CUBE if door or half > 0.0 else _CYLINDER,
        pose=pose,
        scale={"x": wide, "y": deep, "z": height},
        color=color,
        text=mover.name,
    )


POINT = np.dtype(
    [
        ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("body", "<i4"), ("displacement", "<f4"),
        ("incidence", "<f4"), ("kind", "u1"), ("mixed", "u1"),
    ]
)  # fmt: skip
_ROS_TYPES = {"<f4": 7, "<i4": 5, "|u1": 2}  # sensor_msgs/PointField


@njit
def _project(
    ranges: NDArray[np.float32], cos: Float, sin: Float, x: NDArray[Any], y: NDArray[Any]
) -> None:
    """Points (m) of ranges, to the nearest 1 / 1024 m: more digits are noise to store."""
    for k in range(len(ranges)):
        if math.isfinite(ranges[k]):
            x[k] = math.floor(ranges[k] * cos[k] * 1024.0 + 0.5) / 1024.0
            y[k] = math.floor(ranges[k] * sin[k] * 1024.0 + 0.5) / 1024.0
        else:
            x[k] = y[k] = math.nan


def labels_topic(number: int) -> str:
    """Of that scanner of a robot, the first being 0."""
    return LABELS + (scan_topics(number)[0].name if number else "")


class LabelsMessage:
    """sensor_msgs/PointCloud2 in the laser frame, one point a beam; NaN where nothing came back."""

    KIND = "sensor_msgs/msg/PointCloud2"

    def __init__(self, spec: LaserSpec, frame: str = LASER) -> None:
        n = spec.n_beams
        data = Marks()(n * POINT.itemsize, np.uint8)
        offsets = {name: POINT.fields[name][1] for name in POINT.names or ()}  # type: ignore[index]
        fields = [
            message(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=offset,
                datatype=_ROS_TYPES[POINT[name].str],
                count=1,
            )
            for name, offset in offsets.items()
        ]
        prototype = message(
            self.KIND,
            header=header(frame),
            height=1,
            width=n,
            fields=fields,
            point_step=POINT.itemsize,
            row_step=n * POINT.itemsize,
            data=data,
        )
        self._template = Template(self.KIND, prototype)
        self._points: NDArray[np.void] = self._template.view(data).view(POINT)
        self._points["z"] = 0.0
        # libm's cosines: NumPy's own change their last bit with the CPU.
        self._cos = np.array([math.cos(a) for a in spec.angles.tolist()])
        self._sin = np.array([math.sin(a) for a in spec.angles.tolist()])

    def __call__(self, scan: Scan, labels: BeamLabels) -> bytearray:
        """Labels of that scan."""
        points = self._points
        _project(scan.ranges, self._cos, self._sin, points["x"], points["y"])
        points["body"], points["kind"] = labels.body, labels.kind
        points["displacement"], points["incidence"] = labels.displacement, labels.incidence
        points["mixed"] = labels.mixed
        return self._template.stamp(scan.stamp_ns)


Maker = Callable[[Moment], Any]
F = TypeVar("F", bound=Maker)
_topics: dict[str, tuple[str, Maker]] = {}
_OWN = (
    Topic(name="/ground_truth/objects", kind=ObjectsMessage.KIND),
    Topic(name="/ground_truth/labels", kind=LabelsMessage.KIND),
)
OURS = {topic.name: topic for topic in (*STATE, *_OWN, *SCANS)}
"""By name, in the order of a bag's connections."""


def topic(name: str, kind: str) -> Callable[[F], F]:
    """Function decorator: write ``make(moment)`` under that name, once a frame.

    name  as ROS has it: "/robot/speed"
    kind  a ROS 2 type: "std_msgs/msg/Float64"; ``slam.ros.template.message`` makes one

    A frame for which the function returns None has no message. Raises ``InvalidValueError`` for a
    name that is taken or does not begin with '/', ``UnknownNameError`` for an unknown type.
    """
    if not name.startswith("/") or name in OURS or name in _topics:
        taken = ", ".join(sorted({*OURS, *_topics}))
        raise InvalidValueError(
            f"a topic needs a new name that begins with '/', got {name!r}. Taken: {taken}"
        )
    if kind not in STORE.types:
        raise UnknownNameError(f"topic {name}: no ROS 2 type is called {kind!r}")

    def add(make: F) -> F:
        _topics[name] = (kind, make)
        return make

    return add


def names() -> list[str]:
    """Registered topics, sorted."""
    return sorted(_topics)


class MoreTopics:
    """The registered topics of one bag."""

    def __init__(self) -> None:
        self._topics = dict(sorted(_topics.items()))
        self.topics = [Topic(name=name, kind=kind) for name, (kind, _) in self._topics.items()]

    def __call__(self, moment: Moment) -> list[tuple[str, bytearray]]:
        """(topic, message) of those that have one now."""
        found = []
        for name, (kind, make) in self._topics.items():
            made = make(moment)
            if made is not None:
                found.append((name, bytearray(STORE.serialize_cdr(made, kind))))
        return found
