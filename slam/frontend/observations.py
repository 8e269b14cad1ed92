# SPDX-License-Identifier: Apache-2.0
"""Observations as Gaussians: beams and point features enter through one type.

``slam.tracker.rasterise`` writes them onto a map.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from slam._jit import inner, uncounted
from slam.arrays import Bools, Bytes, Float, Float32, Ints
from slam.errors import InvalidValueError
from slam.frames import Features, Frame, Scan
from slam.frontend.config import FRONTEND, FrontendConfig
from slam.frontend.deskew import deskewed
from slam.frontend.surfaces import NEAR_CELLS, face, follow_ends, join, unmixed
from slam.frontend.visibility import (
    SILENT_M,
    View,
    fill,
    n_bins,
    view_of_bins,
    view_of_features,
)  # fmt: skip

SPACING_M = 0.1  # m; beams closer than this share one weight; set by hand
LEAST_WEIGHT = 0.3  # share of a full observation, of a near beam; set by hand
# Guards on what comes in, no settings: an ordinary stream is far from either.
MOST_SWEPT_M = 50.0  # m driven during one sweep; more is a broken twist (5 m/s for 10 s), by hand
MOST_STD_M = 3.0  # m, deviation of a feature used; more would fill 10^5 cells of 3 cm, by hand


class Grain(Protocol):
    """How finely a map takes observations in, and from how far.

    cell_m    edge of a cell, m: the least spread of an observation follows from it
    range_m   returns beyond are ignored, m
    frontend  the other numbers
    """

    @property
    def cell_m(self) -> float:
        """As above."""

    @property
    def range_m(self) -> float:
        """As above."""

    @property
    def frontend(self) -> FrontendConfig:
        """As above."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Observations:
    """What one frame shows, in the robot frame at the frame's stamp.

    points_robot  (n, 2) m
    covariances   (n, 3) m^2: xx, xy, yy; at least (0.8 cell)^2 along every axis
    shares       (n,) share of a full observation
    tangents      (n, 2) unit direction of the surface where it goes on both ways, or may; else 0
    joined        (n,) bool: the surface goes on to the next point. Without it the dots of a wall
                  seen at a grazing angle match themselves where the robot stood before
    facings       (n,) uint8: the way the surface faces, see ``surfaces.face``; 0: unknown
    view          what is seen to be empty
    T_robot_laser (3,) origin of ``view``
    sensor_sigma_m  standard deviation of a range: the scanner's own, or that of the config
    weights       (n,) in [0, 1], of returns where the map is young (``tracker.standing``); None: 1
    in_view       share of the returns whose places scans of the last seconds had in view
    """

    points_robot: Float
    covariances: Float
    shares: Float
    tangents: Float
    joined: Bools
    facings: Bytes
    view: View
    T_robot_laser: Float
    sensor_sigma_m: float = FRONTEND.sensor_sigma_m
    weights: Float | None = None
    in_view: float = 1.0

    @cached_property
    def amount(self) -> float:
        """Sum of the shares."""
        return float(np.add.reduce(self.shares))  # as ``sum``, at two thirds of its time

    @cached_property
    def mean_weight(self) -> float:
        """Mean weight of the returns, 1 where nothing is known of them."""
        weights = self.weights
        if weights is None or not len(weights):
            return 1.0
        return float(np.add.reduce(weights)) / len(weights)  # as ``mean``, at a third of its time

    def weighted(self, weights: Float | None, in_view: float | None = None) -> "Observations":
        """The same with other weights, and ``in_view`` unless None: ``replace`` at a quarter of its
        time.
        """
        other = object.__new__(type(self))
        stays = self.in_view if in_view is None else in_view
        other.__dict__.update(self.__dict__, weights=weights, in_view=stays)
        other.__dict__.pop("mean_weight", None)
        return other


@inner
def _scanned(  # noqa: PLR0913 (kernel)
    ranges: Float32,
    angles: Float,
    offsets: Float,
    T_robot_laser: Float,
    twist: Float,
    limits: tuple[float, float, float, float],
    points: Float,
    beams: Ints,
    bearings: Float,
    free: Float,
) -> tuple[int, bool]:
    """End points in the robot frame of the stamp; bearings and free ranges about that laser.

    ``limits``: range_min, range_max, range of use, free range without a return. Returns how many
    points were written, and whether the bearings rise from beam to beam.
    """
    low, high, use, silent = limits
    lx, ly = T_robot_laser[0], T_robot_laser[1]
    lc, ls = math.cos(T_robot_laser[2]), math.sin(T_robot_laser[2])
    count, rising = 0, True
    for k in range(len(ranges)):
        r = float(ranges[k])
        hit = low <= r <= high
        free[k] = 0.0
        bearings[k] = angles[k]
        if math.isnan(r) or r < low or r == 0.0:
            rising &= k == 0 or bearings[k] >= bearings[k - 1]
            continue
        reach = min(r, use) if hit else silent
        px = lx + reach * math.cos(angles[k] + T_robot_laser[2])
        py = ly + reach * math.sin(angles[k] + T_robot_laser[2])
        px, py = deskewed(px, py, offsets[k], twist)
        dx, dy = px - lx, py - ly
        bearings[k] = math.atan2(lc * dy - ls * dx, lc * dx + ls * dy)
        free[k] = math.sqrt(dx * dx + dy * dy)
        rising &= k == 0 or bearings[k] >= bearings[k - 1]
        if hit and r <= use:
            points[count, 0] = px
            points[count, 1] = py
            beams[count] = k
            count += 1
    return count, rising


@inner
def _cleared(
    points: Float, beams: Ints, origin: Float, joined: Bools, tangents: Float, clear: Bytes
) -> int:
    """Move the hits that are no mixed pixel to the front; how many there are. ``clear``: room."""
    count = unmixed(points, beams, origin, joined, clear)
    if count < len(points):
        m = 0
        for k in range(len(points)):
            if clear[k]:
                points[m, 0], points[m, 1], joined[m] = points[k, 0], points[k, 1], joined[k]
                tangents[m, 0], tangents[m, 1] = tangents[k, 0], tangents[k, 1]
                m += 1
    return count


@inner
def _surveyed(  # noqa: PLR0913 (kernel)
    points: Float,
    beams: Ints,
    origin: Float,
    near: float,
    sweep: tuple[float, int, float],
    variance: float,
    joined: Bools,
    tangents: Float,
    facings: Bytes,
    covariances: Float,
    shares: Float,
) -> int:
    """Surfaces through the hits; those that remain are moved to the front, and their number.

    near  m, see ``join``; sweep  see ``follow_ends``; variance  m^2 of every observation
    """
    join(points, beams, origin, near, joined, tangents)
    follow_ends(points, beams, origin, joined, sweep, tangents)
    count = _cleared(points, beams, origin, joined, tangents, facings)
    face(points[:count], origin, joined, facings)
    for k in range(count):
        covariances[k, 0], covariances[k, 1], covariances[k, 2] = variance, 0.0, variance
        x, y = points[k, 0], points[k, 1]
        share = math.sqrt(x * x + y * y) * sweep[0] / SPACING_M
        shares[k] = min(max(share, LEAST_WEIGHT), 1.0)
    return count


@inner
def _order(bearings: Float, order: Ints, room: Ints) -> None:
    """Fill ``order`` with the beams by rising bearing, equal ones by number: a merge sort, which
    copies what is in order already, as most of a scan is."""
    n, width = len(order), 1
    for k in range(n):
        order[k] = k
    while width < n:
        for start in range(0, n, 2 * width):
            middle, end = min(start + width, n), min(start + 2 * width, n)
            if middle == end or bearings[order[middle - 1]] <= bearings[order[middle]]:
                continue
            i, j = start, middle
            for k in range(start, end):
                if i < middle and (j == end or bearings[order[i]] <= bearings[order[j]]):
                    room[k] = order[i]
                    i += 1
                else:
                    room[k] = order[j]
                    j += 1
            for k in range(start, end):
                order[k] = room[k]
        width *= 2


@inner
def _by_bearing(
    points: Float,
    beams: Ints,
    bearings: Float,
    order: Ints,
    place: Ints,
    room: Float,
) -> None:
    """Of an interlaced scanner that turns: neighbours are those by bearing, not by number.

    Puts the points in that order; ``beams`` count the beams in it from now on.
    """
    _order(bearings, order, place)
    place[:] = -1  # of each beam among the points
    for m in range(len(points)):
        place[beams[m]] = m
        room[m, 0], room[m, 1] = points[m, 0], points[m, 1]
    m = 0
    for k in range(len(order)):
        at = place[order[k]]
        if at >= 0:
            points[m, 0], points[m, 1], beams[m] = room[at, 0], room[at, 1], k
            m += 1


@uncounted
def _observed(  # noqa: PLR0913 (kernel)
    ranges: Float32,
    angles: Float,
    offsets: Float,
    T_robot_laser: Float,
    twist: Float,
    limits: tuple[float, float, float, float],
    sweep: tuple[float, int, float],
    near: float,
    variance: float,
    interlaced: bool,
    points: Float,
    tangents: Float,
    covariances: Float,
    shares: Float,
    joined: Bools,
    facings: Bytes,
    bins: Float,
    room: Float,
    beams: Ints,
) -> tuple[int, float]:
    """All that one scan shows: how many points there are, and the longest free range.

    ``limits`` as ``_scanned`` takes them, the others as ``_surveyed``; ``interlaced``: beams need
    not be sent in order. ``bins`` (2, bins) are limits and offsets of a ``View``; ``room`` (3,
    at least n and bins) and ``beams`` (3, n): room to work in.
    """
    n = len(ranges)
    bearings, free = room[0, :n], room[1, :n]
    count, rising = _scanned(
        ranges, angles, offsets, T_robot_laser, twist, limits, points, beams[0], bearings, free
    )
    if interlaced and not rising:
        # tangents are filled later
        _by_bearing(points[:count], beams[0, :count], bearings, beams[1], beams[2], tangents)
    left = _surveyed(
        points[:count], beams[0, :count], T_robot_laser, near, sweep, variance,
        joined[:count], tangents[:count], facings[:count], covariances, shares,
    )  # fmt: skip
    return left, fill(bearings, free, math.tau / bins.shape[1], bins[0], bins[1], room[2])


def from_scan(scan: Scan, twist: Float, grain: Grain) -> Observations:
    """Beams, moved to where the robot was at the scan's stamp.

    ``twist`` is the body velocity (vx, vy, omega) over the sweep. Raises ``InvalidValueError``
    where that drives more than ``MOST_SWEPT_M`` during it.
    """
    spec = scan.spec
    swept_m = spec.sweep_duration * math.hypot(float(twist[0]), float(twist[1]))
    if swept_m > MOST_SWEPT_M:
        raise InvalidValueError(
            f"Odometry.twist must drive at most {MOST_SWEPT_M:g} m during a scan's sweep, "
            f"got {swept_m:g} m"
        )
    n, config = spec.n_beams, grain.frontend
    use = min(grain.range_m, spec.range_max)
    sensor_sigma_m = spec.range_sigma_m or config.sensor_sigma_m
    points, tangents = np.empty((n, 2)), np.empty((n, 2))
    covariances, shares = np.empty((n, 3)), np.empty(n)
    joined, facings = np.empty(n, np.bool_), np.empty(n, np.uint8)
    bins = np.empty((2, n_bins(spec.angle_increment)))
    left, farthest = _observed(
        scan.ranges, spec.angles, spec.beam_time_offsets, spec.T_robot_laser,
        np.array(twist),  # one that is fixed would be compiled for once more
        (spec.range_min, spec.range_max, use, min(use, SILENT_M)),
        (spec.angle_increment, n, use), NEAR_CELLS * grain.cell_m,
        max(config.sigma_cells * grain.cell_m, sensor_sigma_m) ** 2, spec.sweep_duration > 0.0,
        points, tangents, covariances, shares, joined, facings, bins,
        np.empty((3, max(n, bins.shape[1]))), np.empty((3, n), np.int64),
    )  # fmt: skip
    return Observations(
        points_robot=points[:left],
        covariances=covariances[:left],
        shares=shares[:left],
        tangents=tangents[:left],
        joined=joined[:left],
        facings=facings[:left],
        view=view_of_bins(bins, farthest, grain.cell_m),
        T_robot_laser=spec.T_robot_laser,
        sensor_sigma_m=sensor_sigma_m,
    )


def from_features(features: Features, grain: Grain) -> Observations:
    """Point features within range; their covariance widened to what the lattice can carry.

    Those with a standard deviation beyond ``MOST_STD_M`` are left out.
    """
    points = features.points_robot
    near = (points * points).sum(axis=1) <= grain.range_m**2
    near &= (
        features.covariances.diagonal(axis1=1, axis2=2).max(axis=1, initial=0.0) <= MOST_STD_M**2
    )
    floor = (grain.frontend.sigma_cells * grain.cell_m) ** 2
    given = features.covariances[near]
    covariances = np.stack([given[:, 0, 0] + floor, given[:, 0, 1], given[:, 1, 1] + floor], axis=1)
    return Observations(
        points_robot=points[near].copy(),
        covariances=covariances,
        shares=np.ones(len(covariances)),
        tangents=np.zeros((len(covariances), 2)),
        joined=np.zeros(len(covariances), np.bool_),
        facings=np.zeros(len(covariances), np.uint8),
        view=view_of_features(points[near], grain.cell_m),
        T_robot_laser=np.zeros(3),
        sensor_sigma_m=grain.frontend.sensor_sigma_m,
    )


def observe(frame: Frame, twist: Float, grain: Grain) -> Observations:
    """What a frame shows to a robot that moves with ``twist``: beams, features or both.

    Raises ``InvalidValueError`` for a frame with neither.
    """
    if frame.scan is None and frame.features is None:
        raise InvalidValueError("this SLAM needs a scan or features in every frame")
    if frame.scan is None:
        return from_features(frame.features, grain)  # type: ignore[arg-type]
    beams = from_scan(frame.scan, twist, grain)
    if frame.features is None:
        return beams
    return joined(beams, from_features(frame.features, grain))


def joined(first: Observations, second: Observations) -> Observations:
    """Both, seen with the view of the first."""
    by_point = ("points_robot", "covariances", "shares", "tangents", "joined", "facings")
    both: dict[str, Any] = {
        n: np.concatenate([getattr(first, n), getattr(second, n)]) for n in by_point
    }
    return replace(first, **both)
