# SPDX-License-Identifier: Apache-2.0
"""How the scanner is mounted on the robot: set by hand, and tested on the log itself.

A log without a transform to its scanner is read as if that looked ahead and counted
counter-clockwise. Whether this can be is tested by what the robot drove between two scans: with the
right mounting, odometry lays their points on each other; with a wrong one the walls move away.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from slam import se2
from slam.frames import Float, Frame, LaserSpec, Scan, Stream

KEY_M, KEY_RAD = 0.3, 0.2  # driven or turned between two scans that are compared
FAR_M, FAR_RAD = 2.0, 1.2  # more: they show other things, and odometry is off
MOST_KEYS = 4000  # scans that are kept of a log: 20 MB
MOST_PAIRS = 80  # that are compared: a second
POINTS = 180  # of a scan
SEEN_IN_BOTH = 0.7  # share of the points, those nearest to the other scan's
FLOOR_M = 0.03  # to which points lie on each other at best: spacing, noise, odometry
SURFACES = 3.0  # a pair of scans says as much as so many independent distances: three numbers
LEAST_PAIRS = 5
BETWEEN_DEG = 5  # from a quarter turn; less may be the odometry's own
SURE = math.log(99.0)  # by which one between must be likelier


def remounted(stream: Stream, T_robot_laser: Float | None, *, flip: bool, by: str) -> Stream:
    """The same stream with its scanner mounted so; ``flip``: its beams count the other way round.

    T_robot_laser  (3,) m, m, rad; None: as the stream says
    by             who says so: ``StreamMetadata.mounting``
    """
    specs: dict[int, tuple[LaserSpec, LaserSpec]] = {}  # with the old one, lest its id be reused

    def spec_of(spec: LaserSpec) -> LaserSpec:
        if id(spec) not in specs:
            mount = spec.T_robot_laser if T_robot_laser is None else T_robot_laser
            made = replace(spec, T_robot_laser=mount)
            if flip:
                offsets = spec.beam_time_offsets[::-1]
                made = replace(made, angle_min=-float(spec.angles[-1]), beam_time_offsets=offsets)
            specs[id(spec)] = spec, made
        return specs[id(spec)][1]

    def frame_of(frame: Frame) -> Frame:
        if frame.scan is None:
            return frame
        scan, step, labels = frame.scan, -1 if flip else 1, frame.labels
        shine = scan.intensities
        scan = Scan(
            stamp_ns=scan.stamp_ns,
            ranges=scan.ranges[::step],
            spec=spec_of(scan.spec),
            intensities=None if shine is None else shine[::step],
        )
        if labels is not None and flip:
            labels = type(labels)(**{k: v[::step] for k, v in vars(labels).items()})
        return replace(frame, scan=scan, labels=labels)

    laser = stream.metadata.laser
    return replace(
        stream,
        metadata=replace(
            stream.metadata, laser=None if laser is None else spec_of(laser), mounting=by
        ),
        frames=lambda: map(frame_of, stream.frames()),
    )


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """One way in which the scanner may be mounted, against how the log was read.

    turned_deg   0, 90, 180 or 270 counter-clockwise from there, or a turn between that fits better
    flipped      its beams count the other way round
    probability  of this one, if it is one of those that were tried
    apart_m      m, root mean square, how far two scans' points then lie apart
    """

    turned_deg: int
    flipped: bool
    probability: float
    apart_m: float

    @property
    def as_read(self) -> bool:
        """Whether it is the one that the log was read with."""
        return self.turned_deg == 0 and not self.flipped


Pair = tuple[Float, Float, Float]  # motion (3,), points before and after it


class MountingTest:
    """Keeps scans of a stream, some way apart, and says under which mounting they agree."""

    def __init__(self) -> None:
        self._keys: list[tuple[Float, Float]] = []  # robot in odom (3,), points in laser frame
        self._mount: Float = np.zeros(3)

    def note(self, frame: Frame) -> None:
        """The next frame of the stream."""
        if frame.scan is None or len(self._keys) >= MOST_KEYS:
            return
        pose = frame.odometry.T_odom_robot
        if self._keys:
            step = se2.between(self._keys[-1][0], pose)
            if math.hypot(step[0], step[1]) < KEY_M and abs(step[2]) < KEY_RAD:
                return
        valid = np.flatnonzero(frame.scan.valid)
        chosen = valid[:: max(1, -(-len(valid) // POINTS))]
        angles, ranges = frame.scan.spec.angles[chosen], frame.scan.ranges[chosen]
        points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
        self._keys.append((pose, points.astype(np.float64)))
        self._mount = frame.scan.spec.T_robot_laser

    def pairs(self) -> list[Pair]:
        """Motion (3,) of the robot and the points before and after it; those of most motion."""
        found: list[tuple[float, int, Float, Float, Float]] = []
        for (before, old), (after, new) in zip(self._keys, self._keys[1:], strict=False):
            step = se2.between(before, after)
            far_m, turn = math.hypot(step[0], step[1]), abs(float(step[2]))
            if far_m < FAR_M and turn < FAR_RAD and min(len(old), len(new)) >= POINTS // 6:
                found.append((far_m + turn, len(found), step, old, new))
        most = sorted(found, key=lambda one: -one[0])[:MOST_PAIRS]
        return [one[2:] for one in most]

    def told(self) -> list[Mounting]:
        """All eight, and one between them where it is much likelier; the likeliest first.

        [] where too little was driven to tell.

        Each pair of scans weighs as ``SURFACES`` distances of one Gaussian of unknown width:
        thousands of beams on one wall say it once.
        """
        pairs = self.pairs()
        if len(pairs) < LEAST_PAIRS:
            return []
        ways = [(turned, flip) for flip in (False, True) for turned in (0, 90, 180, 270)]
        found = [self._fit(pairs, *way) for way in ways]
        best = found.index(max(found))
        between = self._between(pairs, *ways[best])
        if between != ways[best]:
            ways.append(between)
            found.append(self._fit(pairs, *between))
        odds = np.exp(np.array([log for log, _ in found]) - max(found)[0])
        apart = np.array([apart_m for _, apart_m in found])
        mountings = [
            Mounting(turned_deg=turned, flipped=flip, probability=p, apart_m=m)
            for (turned, flip), p, m in zip(
                ways, (odds / odds.sum()).tolist(), apart.tolist(), strict=True
            )
        ]
        return sorted(mountings, key=lambda one: -one.probability)

    def _fit(self, pairs: list[Pair], turned_deg: int, flip: bool) -> tuple[float, float]:
        """Log likelihood, and how far the points lie apart, m."""
        squares = np.array([_square(pair, self._mount, turned_deg, flip) for pair in pairs])
        log = -0.5 * SURFACES * float(np.log(squares + FLOOR_M**2).sum())
        return log, math.sqrt(float(np.median(squares)))

    def _between(self, pairs: list[Pair], turned_deg: int, flip: bool) -> tuple[int, bool]:
        """The turn around this quarter that fits best, if it is another one."""
        fits = {turned_deg: self._fit(pairs, turned_deg, flip)}
        tried = range(turned_deg - 40, turned_deg + 41, 8)
        for step in (8, 4, 2, 1):
            fits |= {deg: self._fit(pairs, deg, flip) for deg in tried if deg not in fits}
            best = max(fits, key=lambda deg: fits[deg])
            tried = range(best - step // 2, best + step // 2 + 1, max(step // 2, 1))
        likelier = fits[best][0] - fits[turned_deg][0] > SURE
        other = likelier and abs(best - turned_deg) >= BETWEEN_DEG
        return (best % 360 if other else turned_deg), flip


def _square(pair: Pair, mount: Float, turned_deg: int, flip: bool) -> float:
    """Mean square m^2 between the points of two scans, where the motion between them puts them."""
    step, old, new = pair
    T_robot_laser = np.array([mount[0], mount[1], mount[2] + math.radians(turned_deg)])
    side = np.array([1.0, -1.0 if flip else 1.0])
    T_old_new = se2.between(T_robot_laser, se2.compose(step, T_robot_laser))
    moved = se2.transform(T_old_new, new * side)
    distances = np.sort(cKDTree(old * side).query(moved)[0])
    shared = distances[: max(1, round(SEEN_IN_BOTH * len(distances)))]
    return float((shared * shared).mean())
