# SPDX-License-Identifier: Apache-2.0
"""What others say on the network, read: bytes of strangers, bounded and checked."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from slam import se2
from slam.errors import InvalidValueError, MobiliaError
from slam.estimate import Raster
from slam.frames import Float
from slam.logs import unpacking
from slam.logs.bag import PLANAR, planar, stamp_of
from slam.ros.template import STORE

MOST_CELLS = 1 << 26  # of a map: a square of 400 m at 5 cm
unpacking.bound_rosbags()


class StampedPose(NamedTuple):
    """A pose, and when it was so as its message says; covariance (3, 3), None: none is stated."""

    stamp_ns: int
    pose: Float
    covariance: Float | None = None


def decoded(kind: str, data: bytes) -> Any:
    """The message; ``InvalidValueError`` for bytes that are none."""
    try:
        return STORE.deserialize_cdr(data, kind)
    except MobiliaError:
        raise
    except Exception as error:  # parsers of foreign bytes fail in every way
        raise InvalidValueError(f"{len(data)} bytes that are no {kind}: {error!s:.80}") from error


def transform_of(message: Any, parent: str, child: str) -> StampedPose | None:
    """That transform of a tf2_msgs/TFMessage; None where it has none."""
    for link in message.transforms:
        names = (link.header.frame_id.lstrip("/"), link.child_frame_id.lstrip("/"))
        if names == (parent, child):
            moved = link.transform
            pose = SimpleNamespace(position=moved.translation, orientation=moved.rotation)
            return StampedPose(stamp_of(link, 0), planar(pose))
    return None


def pose_of(message: Any) -> StampedPose:
    """A geometry_msgs/PoseWithCovarianceStamped; all zeros as covariance state nothing."""
    spread = np.asarray(message.pose.covariance)[PLANAR].astype(np.float64)
    said = spread if np.isfinite(spread).all() and spread.any() else None
    return StampedPose(stamp_of(message, 0), planar(message.pose.pose), said)


def raster_of(grid: Any, T_own_map: Float) -> Raster | None:
    """A nav_msgs/OccupancyGrid in the frame of the first pose; None for an empty one.

    T_own_map  of the grid's frame in ours. Raises ``InvalidValueError`` for what cannot be a map.
    """
    width, height = int(grid.info.width), int(grid.info.height)
    if width * height == 0:
        return None
    if width * height > MOST_CELLS or len(grid.data) != width * height:
        raise InvalidValueError(
            f"/map: expected width * height cells, at most {MOST_CELLS}, "
            f"got {width} * {height} and {len(grid.data)} of them"
        )
    cells = grid.data.astype(np.float32).reshape(height, width) / np.float32(100.0)
    cells[(cells < 0.0) | (cells > 1.0)] = np.nan
    origin = se2.compose(T_own_map, planar(grid.info.origin))
    return Raster(values=cells, resolution_m=float(grid.info.resolution), T_map_origin=origin)
