# SPDX-License-Identifier: Apache-2.0
"""What a SLAM says: where the robot is, and what its map is, as cells or as landmarks."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.checked import covariance, frozen, pose, set_fields
from slam.errors import InvalidValueError
from slam.frames import Float


@dataclass(frozen=True, kw_only=True, eq=False)
class Estimate:
    """Where the robot is, as a SLAM estimates it.

    stamp_ns     the frame's stamp
    T_map_robot  (3,) m, m, rad; the map frame is the robot's frame at the first update
    covariance   (3, 3) of (x, y, theta) in the map frame
    converged    False when the system does not trust this estimate; never a plausible stand-in
    diagnostics  JSON-serialisable numbers and words, e.g. {"state": "tracking", "matched": 0.97}.
                 "unobservable": number of directions of position (0, 1 or 2) about which the sensor
                 says nothing now, as along a bare corridor; "unobservable_rad": the one direction,
                 in the map frame. ``converged`` stays True then: nothing is wrong, the estimate is
                 odometry's there, and the covariance grows along it
    """

    stamp_ns: int
    T_map_robot: Float
    covariance: Float
    converged: bool = True
    diagnostics: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.converged, int | np.bool_):
            raise InvalidValueError(
                f"Estimate.converged must be True or False, got {self.converged!r:.80}"
            )
        if not isinstance(self.diagnostics, Mapping):
            raise InvalidValueError(
                f"Estimate.diagnostics must be a mapping, got {self.diagnostics!r:.80}"
            )
        set_fields(
            self,
            T_map_robot=pose("Estimate", "T_map_robot", self.T_map_robot),
            covariance=covariance("Estimate", "covariance", self.covariance),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Raster:
    """A map as an image of existence.

    values        (height, width) float32 in [0, 1], NaN unknown; row 0 is the lowest y
    resolution_m  edge of a cell, m
    T_map_origin  (3,) pose of the outer corner of values[0, 0] in the map frame
    """

    values: NDArray[np.float32]
    resolution_m: float
    T_map_origin: Float

    def __post_init__(self) -> None:
        values = frozen("Raster", "values", self.values, (None, None), np.float32)
        # NaN where all are: without a copy of what is known, which a large map has no room for
        low, high = (f.reduce(values, axis=None, initial=np.nan) for f in (np.fmin, np.fmax))
        if low < 0.0 or high > 1.0:
            raise InvalidValueError(
                f"Raster.values must lie in [0, 1] or be NaN, got {low}..{high}"
            )
        if not 0.0 < self.resolution_m < np.inf:
            raise InvalidValueError(f"Raster.resolution_m must be > 0 m, got {self.resolution_m}")
        origin = pose("Raster", "T_map_origin", self.T_map_origin)
        set_fields(self, values=values, T_map_origin=origin)


@dataclass(frozen=True, kw_only=True, eq=False)
class Changes:
    """Short-term against long-term memory, on the same cells; NaN where no neuron lives.

    appeared  what was seen lately beyond what was there on the whole: the input that would hold the
              short-term activity, less the long-term trace within two neurons
    gone      the trace less that input within two neurons: a neuron forgets only while seen empty
    """

    appeared: Raster
    gone: Raster


@dataclass(frozen=True, kw_only=True, eq=False)
class Landmarks:
    """A map of points.

    keys         (n,) int64 names, never used twice
    points_map   (n, 2) m
    covariances  (n, 2, 2) m^2 in the map frame
    looks        (n,) int64 how often each was seen
    """

    keys: NDArray[np.int64]
    points_map: Float
    covariances: Float
    looks: NDArray[np.int64]

    def ellipses(self) -> Float:
        """(n, 5) of 3 sigma: centre x, y (m), half axes (m), direction of the first axis (rad)."""
        values, vectors = np.linalg.eigh(self.covariances)
        axes = 3.0 * np.sqrt(np.maximum(values[:, ::-1], 0.0))
        angles = np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1])
        return np.column_stack([self.points_map, axes, angles])
