# SPDX-License-Identifier: Apache-2.0
"""Truth per beam as a sensor_msgs/PointCloud2."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam._jit import njit
from slam.frames import BeamLabels, Float, LaserSpec, Scan
from slam.ros.messages import LASER
from slam.ros.template import Marks, Template, header, message

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


class LabelsMessage:
    """sensor_msgs/PointCloud2 in the laser frame, one point a beam; NaN where nothing came back."""

    KIND = "sensor_msgs/msg/PointCloud2"

    def __init__(self, spec: LaserSpec) -> None:
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
            header=header(LASER),
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
