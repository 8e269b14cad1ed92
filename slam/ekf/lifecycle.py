# SPDX-License-Identifier: Apache-2.0
"""Which objects are landmarks: the classification of the paper's rival (section 4.1).

"Every time an object was re-observed, it was added as a state variable; landmarks are deleted if
they cannot be observed again." An object seen once is a *candidate*: it has its rows in the
covariance, so that what its first observation said is not lost, but nothing is associated with it
until all confirmed landmarks have had their say. Existence is a log-odds: a look that sees the
object adds log(d / c), one that should and does not adds log((1 - d) / (1 - c)), with d the
probability of detection and c that of seeing something else there. At zero the object goes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam.ekf.config import EkfConfig
from slam.frames import Float, Scan
from slam.frontend.corners import answered
from slam.frontend.polar import hidden, polar

EKF = EkfConfig()


class Lifecycle:
    """What is known of each landmark of the filter, in the filter's order.

    keys       (n,) int64, never used twice: names that outlive deletions
    looks      (n,) int64 times seen
    existence  (n,) log-odds
    """

    def __init__(self, config: EkfConfig) -> None:
        self._config = config
        self._seen_adds = math.log(config.detection / config.lifecycle.chance)
        self._missed_adds = math.log((1.0 - config.detection) / (1.0 - config.lifecycle.chance))
        self._next_key = 0
        self.keys: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.looks: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self.existence: Float = np.zeros(0)
        self.deleted = 0

    @property
    def confirmed(self) -> NDArray[np.bool_]:
        """(n,) bool: seen often enough to be a landmark."""
        return self.looks >= self._config.confirm_looks

    def add(self, n: int) -> None:
        """n objects seen for the first time, at the end of the order."""
        self.keys = np.concatenate([self.keys, np.arange(self._next_key, self._next_key + n)])
        self.looks = np.concatenate([self.looks, np.ones(n, dtype=np.int64)])
        self.existence = np.concatenate([self.existence, np.full(n, self._seen_adds)])
        self._next_key += n

    def judge(
        self,
        seen: NDArray[np.int64],
        expected: NDArray[np.bool_],
        left_behind: NDArray[np.bool_],
    ) -> NDArray[np.int64]:
        """Count one frame; the indices that can go.

        expected     (n,) should have been seen
        left_behind  (n,) out of view: candidates there go, else every thing that ever moved would
                     stay in the state
        """
        missed = expected.copy()
        missed[seen] = False
        self.looks[seen] += 1
        self.existence[seen] += self._seen_adds
        self.existence[missed] += self._missed_adds
        ceiling = self._config.memory_looks * self._seen_adds
        self.existence = np.minimum(self.existence, ceiling)
        return np.flatnonzero((self.existence <= 0.0) | (left_behind & ~self.confirmed))

    def remove(self, gone: NDArray[np.int64]) -> None:
        """Forget these; counts how many of them were confirmed."""
        self.deleted += int(self.confirmed[gone].sum())
        self.keys = np.delete(self.keys, gone)
        self.looks = np.delete(self.looks, gone)
        self.existence = np.delete(self.existence, gone)


def in_view(
    landmarks_robot: Float, config: EkfConfig, rim: float | None = None
) -> NDArray[np.bool_]:
    """(n,) landmarks (n, 2), robot frame, within the share ``rim`` of range and field of view;
    None: the share within which they surely are in view.
    """
    rim = config.lifecycle.within if rim is None else rim
    distance, bearing = polar(landmarks_robot)
    half = math.radians(config.fov_deg) / 2.0
    inside: NDArray[np.bool_] = (np.abs(bearing) < rim * half) | (config.fov_deg >= 360.0)
    return inside & (distance < rim * config.range_m)


def unhidden_by_features(
    landmarks_robot: Float, points_robot: Float, config: EkfConfig
) -> NDArray[np.bool_]:
    """(n,) False where an observed thing stands before the landmark: within the angle that
    ``occluder_m`` fills at its distance, and nearer than the landmark by as much."""
    if config.occluder_m == 0.0:
        return np.ones(len(landmarks_robot), dtype=np.bool_)
    return ~hidden(landmarks_robot, points_robot, config.occluder_m)


def unhidden_by_beams(
    landmarks_laser: Float, scan: Scan, config: EkfConfig = EKF
) -> NDArray[np.bool_]:
    """(n,) True where every beam at the landmark (laser frame) passes beyond it: it is gone.

    A beam that ends before it says that it is hidden; one that ends at it, that something is there
    although no feature was found. Neither is a miss. Takes the three beams nearest in direction.
    """
    spec = scan.spec
    distance, bearing = polar(landmarks_laser)
    beam = np.round((bearing - spec.angle_min) / spec.angle_increment).astype(np.int64)
    inside = (beam >= 1) & (beam < spec.n_beams - 1)
    beam = np.clip(beam, 1, max(spec.n_beams - 2, 1))
    ranges = answered(scan, config.extractor.failed)
    if spec.n_beams < 3:
        return np.zeros(len(landmarks_laser), dtype=np.bool_)
    shortest = np.minimum(np.minimum(ranges[beam - 1], ranges[beam]), ranges[beam + 1])
    return inside & (shortest > distance + config.lifecycle.behind_m)
