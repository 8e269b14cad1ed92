# SPDX-License-Identifier: Apache-2.0
"""The state of EKF-SLAM, pose and point landmarks, and the four things that happen to it."""

import math

import numpy as np
from numpy.typing import ArrayLike

from slam import se2
from slam.arrays import Float, Ints
from slam.errors import InvalidValueError
from slam.frontend import odometry_prior
from slam.landmarks import kernels

_FIRST_CAPACITY = 32
MOST_STD_M = 1e3  # of an increment; with more, rounding would eat a millimetre sensor


class EkfFilter:
    """Pose and landmarks with their joint covariance: an iterated, right-invariant EKF.

    pose       (3,) T_map_robot
    landmarks  (n, 2) m in the map frame
    error_covariance  (3 + 2 n, 3 + 2 n) of the invariant error (see ``slam.landmarks.kernels``),
                      in the
               order x, y, theta, landmark 0 x, y, ...

    ``pose_covariance`` and ``landmark_covariances`` say the same in plain map coordinates. The
    filter starts at the origin, which it knows exactly.
    """

    def __init__(self) -> None:
        self.pose: Float = np.zeros(3)
        self._n = 0
        self._landmarks: Float = np.zeros((_FIRST_CAPACITY, 2))
        self._P: Float = np.zeros((3 + 2 * _FIRST_CAPACITY, 3 + 2 * _FIRST_CAPACITY))

    def __len__(self) -> int:
        return self._n

    @property
    def landmarks(self) -> Float:
        """(n, 2) m, a view."""
        return self._landmarks[: self._n]

    @property
    def error_covariance(self) -> Float:
        """(3 + 2 n, 3 + 2 n), a view."""
        size = 3 + 2 * self._n
        return self._P[:size, :size]

    def predict(self, increment: ArrayLike, covariance: ArrayLike) -> None:
        """Move by ``increment`` (3,) with its covariance (3, 3), both in the last robot frame.

        A shift w and a turn t end at w, on the group's straight line at V(t) w = w + t J w / 2: the
        second term (1.5 mm for 0.1 m and 0.03 rad) is more than a good sensor's noise, so its
        covariance is added. Standard deviations beyond ``MOST_STD_M`` or half a turn mean "not
        known": they are lowered to these, the correlations kept.
        """
        heading = float(self.pose[2])
        self.pose = se2.compose(self.pose, increment)
        Q = odometry_prior.known(np.asarray(covariance), MOST_STD_M, math.pi)
        bend = 0.25 * Q[2, 2]
        Q[:2, :2] += bend * np.array([[Q[1, 1], -Q[0, 1]], [-Q[0, 1], Q[0, 0]]])
        kernels.disturb(self._P, self.pose, self._landmarks, self._n, heading, Q)

    def update(self, landmarks: ArrayLike, points_robot: Float, covariances: Float) -> float:
        """Take in that point i (m, 2) with covariance i (m, 2, 2) is landmark ``landmarks[i]``.

        Iterated (Gauss-Newton), all points at once. Returns the joint cost (chi-square, 2 m degrees
        of freedom). Raises ``InvalidValueError`` where two points are one landmark or where neither
        points nor state have any uncertainty.
        """
        matched = np.asarray(landmarks, dtype=np.int64)
        if len(matched) == 0:
            return 0.0
        if len(np.unique(matched)) != len(matched) or not 0 <= matched.min() <= matched.max() < len(
            self
        ):
            raise InvalidValueError(
                f"landmarks must be different indices in [0, {len(self)}), got {matched.tolist()}"
            )
        cost = kernels.absorb(
            self.pose, self._landmarks, self._n, self._P, matched, points_robot, covariances
        )
        if cost < 0.0:
            raise InvalidValueError(
                "the innovation has no positive definite covariance: give the points some"
            )
        return float(cost)

    def add(self, points_robot: Float, covariances: Float) -> Ints:
        """New landmarks from points (m, 2) seen now, fully correlated with all there is.

        l = p + R z, so xi_l = xi_p + R n. Returns their indices (m,).
        """
        first, m = self._n, len(points_robot)
        self._grow(first + m)
        turned = _turned(float(self.pose[2]), covariances)
        self._landmarks[first : first + m] = se2.transform(self.pose, points_robot)
        P, size = self._P, 3 + 2 * first
        for k in range(m):
            a = size + 2 * k
            P[a : a + 2, :a] = P[0:2, :a]
            P[:a, a : a + 2] = P[:a, 0:2]
            P[a : a + 2, a : a + 2] = P[0:2, 0:2] + turned[k]
        self._n = first + m
        return np.arange(first, first + m)

    def remove(self, landmarks: ArrayLike) -> None:
        """Forget landmarks: their rows and columns go, the rest stays as it is."""
        gone = np.asarray(landmarks, dtype=np.int64)
        if len(gone) == 0:
            return
        keep = np.setdiff1d(np.arange(self._n), gone)
        rows = np.concatenate([[0, 1, 2], np.stack([3 + 2 * keep, 4 + 2 * keep], axis=1).ravel()])
        n, size = len(keep), 3 + 2 * len(keep)
        self._landmarks[:n] = self._landmarks[keep]
        self._P[:size, :size] = self._P[np.ix_(rows, rows)]
        self._n = n

    def pose_covariance(self) -> Float:
        """(3, 3) of (x, y, theta) in the map frame."""
        out: Float = self._plain(self.pose[None, :2], np.zeros(1, dtype=np.int64))[0]
        return out

    def landmark_covariances(self) -> Float:
        """(n, 2, 2) m^2 in the map frame."""
        return self._plain(self.landmarks, 3 + 2 * np.arange(self._n))[:, :2, :2]

    def _plain(self, points: Float, places: Ints) -> Float:
        """(k, 3, 3) covariance of each (point, heading): dp = xi_p + J p dtheta, ``places`` (k,)
        being those of the xi_p."""
        P, x, y = self._P, points[:, 0], points[:, 1]
        turn = P[2, 2]
        a, b = P[places, 2], P[places + 1, 2]
        out = np.empty((len(points), 3, 3))
        out[:, 0, 0] = P[places, places] - 2.0 * y * a + y * y * turn
        out[:, 1, 1] = P[places + 1, places + 1] + 2.0 * x * b + x * x * turn
        out[:, 0, 1] = out[:, 1, 0] = P[places, places + 1] + x * a - y * b - x * y * turn
        out[:, 0, 2] = out[:, 2, 0] = a - y * turn
        out[:, 1, 2] = out[:, 2, 1] = b + x * turn
        out[:, 2, 2] = turn
        return out

    def _grow(self, n: int) -> None:
        if n <= len(self._landmarks):
            return
        capacity = max(n, 2 * len(self._landmarks))
        landmarks, P = self._landmarks, self._P
        self._landmarks = np.zeros((capacity, 2))
        self._landmarks[: len(landmarks)] = landmarks
        self._P = np.zeros((3 + 2 * capacity, 3 + 2 * capacity))
        self._P[: len(P), : len(P)] = P


def _turned(heading: float, covariances: Float) -> Float:
    """(k, 2, 2) from the robot frame into the map frame."""
    c, s = math.cos(heading), math.sin(heading)
    xx, yy = covariances[:, 0, 0], covariances[:, 1, 1]
    xy = 0.5 * (covariances[:, 0, 1] + covariances[:, 1, 0])
    out = np.empty(covariances.shape)
    out[:, 0, 0] = c * c * xx - 2.0 * c * s * xy + s * s * yy
    out[:, 1, 1] = s * s * xx + 2.0 * c * s * xy + c * c * yy
    out[:, 0, 1] = out[:, 1, 0] = c * s * (xx - yy) + (c * c - s * s) * xy
    return out


def from_range_bearing(
    range_m: float, bearing: float, range_std_m: float, bearing_std: float
) -> tuple[Float, Float]:
    """A point (2,) m and its covariance (2, 2) m^2 from a range and a bearing (rad), first order.

    The update of a point with this covariance is the range-bearing update, but for the curvature of
    the arc within one standard deviation of the sensor's own noise.
    """
    c, s = math.cos(bearing), math.sin(bearing)
    radial, lateral = range_std_m**2, (range_m * bearing_std) ** 2
    across = c * s * (radial - lateral)
    covariance = [
        [c * c * radial + s * s * lateral, across],
        [across, s * s * radial + c * c * lateral],
    ]
    return np.array([range_m * c, range_m * s]), np.array(covariance)
