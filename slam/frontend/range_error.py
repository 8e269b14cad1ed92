# SPDX-License-Identifier: Apache-2.0
"""The scanner's systematic error, learnt from surfaces that were seen twice.

A range r reported at an incidence a is off by e(r, a) = Σ c_k φ_k(r) + c_K tan²a, with hats φ_k. A
surface with normal n, seen from two poses, once along u and once along v, lies off itself by

    d = (n·u) e(r, a) − (n·v) e(s, b) + n·x + (n × p) θ + noise,

x and θ what the poses between the two scans are off. They are estimated with the rest in each pair
of scans and marginalised, so that an error of the pose is not taken for one of the scanner. Ranges
are compared as reported: what was learnt before does not feed back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slam import se2
from slam.frames import NS_PER_S, Float, Frame, Scan
from slam.frontend.deskew import end_points
from slam.frontend.polar import polar

# Set by hand, but for what data sheets say.
KNOT_M, RANGE_M = 0.75, 15.0  # m between the knots of the function of range; the last of them
SIGMA_M = 0.02  # m, of that function before any scan; data sheets: typically 15 to 50 mm
LENGTH_M = 2.0  # m, over which that function changes
SIGMA_TAN2_M = 0.002  # m, of the error per squared tangent of the incidence, before any scan
MOST_TAN2 = 9.0  # squared tangent beyond which that term grows no further: 72 degrees
PINNED_M = 1e-5  # m, deviation of what is unobservable: none
STEEPEST_DEG = 72.0  # incidence beyond which nothing is learnt
WIDTH_M = 0.3  # m, length of surface to which a line is fitted
FLAT_SIGMAS = 2.5  # most deviation from that line, of the ranges' own
STEP_M, STEP_RAD = 0.25, 0.35  # m driven or rad turned between two scans learnt from
FASTEST_RADPS = 0.6  # turning faster, a scan is not learnt from
VIEWS, PAIRS = 24, 4  # scans kept to compare with; of them compared with a new one
GATE_M = 0.12  # m, most distance between two sights of a surface
OUTLIER_SIGMAS = 3.0  # a distance counts half from here on
INDEPENDENT = 0.1  # share of the information of a comparison: its errors are shared
POSITION_M, HEADING_RAD = 0.1, 0.05  # prior of the pose between two scans, 1 sigma
EVIDENCE = 5.0  # nat, log of the odds for an error, from which on it is taken off
LASTS_S = 1200.0  # s, memory: a scanner warms up
REDRAW_BY_M = 0.002  # m, change of the error, r.m.s., for which the map is drawn again
REDRAW_M = 45.0  # m driven, up to which that is done; longer runs have loops
REDRAWN_KEYS = 2  # key frames drawn with each scan
DRIFT_M, DRIFT_RAD = 0.03, 0.02  # prior of a key frame from the one before, 1 sigma
DIGITS = 6  # of m that a correction has: those beyond follow the processor's linear algebra


@dataclass(frozen=True, kw_only=True, eq=False)
class Sights:
    """The surfaces of one scan, by rising bearing, in the laser's frame at the stamp.

    points, anchors  (n, 2) m: end of the beam; where its surface's fitted line lies
    bearings, ranges (n,) rad and m, as reported
    normals          (n, 2) of the fitted line, towards the laser
    facing           (n,) n·u, minus the cosine of the incidence
    flat             (n,) the line is a surface, not steeper than what is learnt from
    """

    points: Float
    anchors: Float
    bearings: Float
    ranges: Float
    normals: Float
    facing: Float
    flat: NDArray[np.bool_]


def _window_sums(values: Float, low: NDArray[np.int64], high: NDArray[np.int64]) -> Float:
    """Sums of rows ``low`` to ``high``, both included."""
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    out: Float = sums[high + 1] - sums[low]
    return out


def _lines(covariance: Float) -> tuple[Float, Float, Float]:
    """Normals (n, 2), least variances, and half the difference of both; of xx, xy, yy (3, n)."""
    xx, xy, yy = covariance
    spread = np.sqrt(0.25 * (xx - yy) ** 2 + xy**2)
    least = np.maximum(0.5 * (xx + yy) - spread, 0.0)
    along = 0.5 * np.arctan2(2.0 * xy, xx - yy)
    return np.stack([-np.sin(along), np.cos(along)], axis=1), least, spread


def sights(scan: Scan, twist: Float, sigma_m: float) -> Sights:
    """Lines through neighbouring returns; ``twist`` (vx, vy, omega) is held over the sweep."""
    points, bearings, distances, ranges = _by_bearing(scan, twist)
    half = np.ceil(0.5 * WIDTH_M / np.maximum(distances * scan.spec.angle_increment, 1e-6))
    half = np.clip(half, 2, 40).astype(np.int64)
    count, mean, covariance = _moments(points, half)
    directions = points / np.maximum(distances, 1e-9)[:, None]
    normals, least, spread = _lines(covariance)
    # Ranges err along the beam, which tilts the line of an oblique surface: without that part
    share = least / np.maximum((normals * directions).sum(axis=1) ** 2, 0.05)
    ux, uy = directions.T
    normals, _, _ = _lines(covariance - share * np.stack([ux * ux, ux * uy, uy * uy]))
    facing = (normals * directions).sum(axis=1)
    normals *= -np.sign(facing)[:, None]
    facing = -np.maximum(np.abs(facing), 1e-3)
    off = ((points - mean) * normals).sum(axis=1)
    steepest = math.cos(math.radians(STEEPEST_DEG))
    limit = FLAT_SIGMAS * sigma_m
    flat = (count == 2 * half + 1) & (least < limit**2) & (np.abs(off) < 2.0 * limit)
    flat &= (-facing > steepest) & (spread > 16.0 * sigma_m**2)
    return Sights(
        points=points, anchors=points - off[:, None] * normals, bearings=bearings,
        ranges=ranges - off / facing, normals=normals, facing=facing, flat=flat,
    )  # fmt: skip


def _by_bearing(scan: Scan, twist: Float) -> tuple[Float, Float, Float, Float]:
    """Returns in the laser's frame at the stamp: points, bearings, distances; ranges reported."""
    spec = scan.spec
    hit = np.flatnonzero(scan.valid)
    ends = end_points(
        scan.ranges[hit].astype(np.float64), spec.angles[hit], spec.beam_time_offsets[hit],
        spec.T_robot_laser, np.asarray(twist, dtype=np.float64),
    )  # fmt: skip
    points = se2.transform(se2.inverse(spec.T_robot_laser), ends)
    distances, bearings = polar(np.ascontiguousarray(points))
    order = np.argsort(bearings, kind="stable")
    ranges = scan.ranges[hit][order].astype(np.float64)
    return points[order], bearings[order], distances[order], ranges


def _moments(points: Float, half: NDArray[np.int64]) -> tuple[Float, Float, Float]:
    """Of each point and ``half`` neighbours on each side: number, mean, xx, xy and yy (3, n)."""
    rows = np.arange(len(points))
    low, high = np.maximum(rows - half, 0), np.minimum(rows + half, len(points) - 1)
    x, y = points[:, 0], points[:, 1]
    sums = _window_sums(np.stack([x, y, x * x, x * y, y * y], axis=1), low, high)
    count = (high - low + 1).astype(np.float64)
    mean = sums / count[:, None]
    covariance = np.stack(
        [
            mean[:, 2] - mean[:, 0] ** 2,
            mean[:, 3] - mean[:, 0] * mean[:, 1],
            mean[:, 4] - mean[:, 1] ** 2,
        ]
    )
    return count, mean[:, :2], covariance


def hats(ranges: Float, knots: int, spacing: float) -> Float:
    """(n, knots) shares of the knots at 0, spacing, ...: straight lines between them."""
    at = np.clip(ranges / spacing, 0.0, knots - 1.0)
    low = np.minimum(at.astype(np.int64), knots - 2)
    out = np.zeros((len(ranges), knots))
    rows = np.arange(len(ranges))
    out[rows, low] = 1.0 - (at - low)
    out[rows, low + 1] = at - low
    return out


class RangeError:
    """Coefficients of e(r, a), what is known of them, and the ranges without them.

    ``sigma_m`` of a range is that of the scanner's noise, for the weights.
    """

    def __init__(self) -> None:
        self.knots = math.ceil(RANGE_M / KNOT_M) + 1
        at = KNOT_M * np.arange(self.knots)
        apart = math.sqrt(5.0) * np.abs(at[:, None] - at[None, :]) / LENGTH_M
        prior = np.zeros((self.knots + 1, self.knots + 1))
        prior[:-1, :-1] = SIGMA_M**2 * (1.0 + apart + apart**2 / 3.0) * np.exp(-apart)
        prior[-1, -1] = SIGMA_TAN2_M**2
        self._prior = prior
        self._precision = np.linalg.inv(prior)
        self._information = np.zeros_like(prior)
        self._vector = np.zeros(self.knots + 1)
        self.reach = np.zeros(self.knots)
        self.coefficients: Float = np.zeros(self.knots + 1)
        self.covariance: Float = prior
        self.odds = 0.0
        self.found = False  # beyond doubt: it is taken off

    def design(self, ranges: Float, facing: Float) -> Float:
        """(n, knots + 1) of the basis functions."""
        tan2 = np.minimum(1.0 / np.maximum(facing**2, 1e-6) - 1.0, MOST_TAN2)
        return np.column_stack([hats(ranges, self.knots, KNOT_M), tan2])

    def at(self, ranges: Float, coefficients: Float | None = None) -> Float:
        """(n,) m by which ranges are off, but for the incidence; ``coefficients``: others."""
        by = self.coefficients if coefficients is None else coefficients
        off: Float = np.round(hats(ranges, self.knots, KNOT_M) @ by[:-1], DIGITS)
        return off

    def sigma_m(self, ranges: Float) -> Float:
        """(n,) m, standard deviation of ``at``: the prior's where nothing was learnt."""
        shares = hats(ranges, self.knots, KNOT_M)
        variances = ((shares @ self.covariance[:-1, :-1]) * shares).sum(axis=1)
        out: Float = np.round(np.sqrt(np.maximum(variances, 0.0)), DIGITS)
        return out

    def differ_m(self, one: Float, other: Float) -> float:
        """Root mean square of what two sets of coefficients take off the ranges seen."""
        if self.reach.sum() == 0.0:
            return 0.0
        squares = (one[:-1] - other[:-1]) ** 2
        return math.sqrt(float(self.reach @ squares / self.reach.sum()))

    def compare(self, new: Sights, old: Sights, T_old_new: Float, sigma_m: float) -> int:
        """Learn from the surfaces seen in both; returns how many returns were compared."""
        mine = np.flatnonzero(new.flat)
        if not len(mine) or not old.flat.any():
            return 0
        there = se2.transform(T_old_new, new.anchors[mine])
        _, bearings = polar(np.ascontiguousarray(there))
        right = np.clip(np.searchsorted(old.bearings, bearings), 1, len(old.bearings) - 1)
        nearer = bearings - old.bearings[right - 1] < old.bearings[right] - bearings
        theirs = right - nearer
        turn = se2.rotation(float(T_old_new[2]))
        normals = old.normals[theirs]
        off = ((there - old.anchors[theirs]) * normals).sum(axis=1)
        alike = ((new.normals[mine] @ turn.T) * normals).sum(axis=1)
        close = np.abs(bearings - old.bearings[theirs]) < 0.02
        kept = old.flat[theirs] & close & (np.abs(off) < GATE_M) & (alike > 0.95)
        if kept.sum() < 12:
            return 0
        mine, theirs, there, normals = mine[kept], theirs[kept], there[kept], normals[kept]
        off = off[kept]
        directions = new.points[mine] @ turn.T
        directions /= np.sqrt((directions**2).sum(axis=1))[:, None]
        facing = (normals * directions).sum(axis=1)
        # Ranges at the surface midway between both sights: at their own, the noise of a range would
        # be in the residual and in its regressor, and the scale of the room would follow it.
        own = new.ranges[mine] - 0.5 * off / facing
        other = old.ranges[theirs] + 0.5 * off / old.facing[theirs]
        basis = facing[:, None] * self.design(own, facing)
        basis -= old.facing[theirs][:, None] * self.design(other, old.facing[theirs])
        lever = normals[:, 1] * there[:, 0] - normals[:, 0] * there[:, 1]
        pose = np.column_stack([normals, lever])
        variance = sigma_m**2 * facing**2 * 1.3 + 1e-6
        self._take(pose, basis, off, variance)
        self.reach += hats(own, self.knots, KNOT_M).sum(axis=0)
        return len(mine)

    def _take(self, pose: Float, basis: Float, off: Float, variance: Float) -> None:
        prior = np.diag([POSITION_M**-2, POSITION_M**-2, HEADING_RAD**-2])
        weights = 1.0 / variance
        left = off - basis @ self.coefficients
        for _ in range(3):
            weighted = pose * weights[:, None]
            step = np.linalg.solve(prior + pose.T @ weighted, weighted.T @ left)
            wild = (left - pose @ step) ** 2 / (variance * OUTLIER_SIGMAS**2)
            weights = 1.0 / (variance * (1.0 + wild) ** 2)
        weighted = pose * weights[:, None]
        inner = np.linalg.inv(prior + pose.T @ weighted)
        cross = weighted.T @ basis
        heavy = basis * weights[:, None]
        self._information += INDEPENDENT * (heavy.T @ basis - cross.T @ inner @ cross)
        self._vector += INDEPENDENT * (heavy.T @ off - cross.T @ (inner @ (weighted.T @ off)))

    def fade(self, elapsed_s: float) -> None:
        """Forget slowly."""
        kept = math.exp(-elapsed_s / LASTS_S)
        self._information *= kept
        self._vector *= kept
        self.reach *= kept

    def solve(self) -> None:
        """The coefficients, their covariance, and the odds that there is an error at all.

        The scale over the ranges that were seen is pinned to zero.
        """
        if self.reach.sum() == 0.0:
            return
        pinned = self._precision + self._gauge()
        _, before = np.linalg.slogdet(pinned)
        _, after = np.linalg.slogdet(pinned + self._information)
        self.covariance = np.asarray(np.linalg.inv(pinned + self._information), dtype=np.float64)
        self.coefficients = self.covariance @ self._vector
        self.odds = 0.5 * float(self._vector @ self.coefficients - (after - before))
        self.found = self.odds > (0.0 if self.found else EVIDENCE)

    def _gauge(self) -> Float:
        """Precision of what is unobservable: an error proportional to the range."""
        scale = KNOT_M * np.arange(self.knots)
        shares = self.reach / self.reach.sum()
        pinned = np.append(shares * scale, 0.0)
        return np.outer(pinned, pinned) / (PINNED_M**2 * float(shares @ scale**2))


class RangeCorrection:
    """Takes the learnt error off the ranges, and learns on from where the SLAM puts the robot."""

    def __init__(self, sensor_sigma_m: float) -> None:
        self._sigma_m = sensor_sigma_m
        self.error = RangeError()
        self._views: list[tuple[Float, Sights]] = []
        self._before_ns: int | None = None

    @property
    def applied(self) -> Float:
        """(knots + 1,) coefficients that are taken off now; zeros while there is no error."""
        return self.error.coefficients if self.error.found else np.zeros(self.error.knots + 1)

    def forget_views(self) -> None:
        """The pose has jumped: the next scan is compared with later ones only."""
        self._views.clear()

    def seen(self, frame: Frame) -> Frame:
        """The frame with the error taken off its ranges; itself while there is none to speak of."""
        scan = frame.scan
        if scan is None or not self.error.found:
            return frame
        hit = np.flatnonzero(scan.valid)
        ranges = scan.ranges.copy()
        reported = ranges[hit].astype(np.float64)
        ranges[hit] = np.maximum(reported - self.error.at(reported), 1e-3)
        return replace(frame, scan=replace(scan, ranges=ranges))

    def learn(self, frame: Frame, twist: Float, T_map_robot: Float, *, tracked: bool) -> None:
        """From ranges as reported, seen at ``T_map_robot``; most scans are too near to the last."""
        scan = frame.scan
        if not tracked:
            self.forget_views()
        if scan is None or not tracked:
            return
        T_map_laser = se2.compose(T_map_robot, scan.spec.T_robot_laser)
        if abs(float(twist[2])) > FASTEST_RADPS or not self._is_new(T_map_laser):
            return
        sigma_m = scan.spec.range_sigma_m or self._sigma_m
        new = sights(scan, twist, sigma_m)
        count = len(self._views)
        for back in [2**k - 1 for k in range(1, PAIRS + 1)]:
            if back <= count:
                T_map_old, old = self._views[count - back]
                self.error.compare(new, old, se2.between(T_map_old, T_map_laser), sigma_m)
        if self._before_ns is not None:
            self.error.fade((scan.stamp_ns - self._before_ns) / NS_PER_S)
        self._before_ns = scan.stamp_ns
        self._views = [*self._views, (T_map_laser, new)][-VIEWS:]
        self.error.solve()

    def _is_new(self, T_map_laser: Float) -> bool:
        if not self._views:
            return True
        step = se2.between(self._views[-1][0], T_map_laser)
        far = math.hypot(float(step[0]), float(step[1])) >= STEP_M
        return far or abs(se2.wrap(float(step[2]))) >= STEP_RAD
