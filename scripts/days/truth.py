# SPDX-License-Identifier: Apache-2.0
"""What truly changed between two simulated sessions, and how much of it a list of changes tells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scenes.kinds import is_door
from scripts.comparison.recording import Recording
from scripts.comparison.sight import Sight
from slam import se2
from slam.days.changes import Change
from slam.days.evidence import Snapshot
from slam.days.history import dense
from slam.frames import Float

STILL_M, STILL_RAD = 0.1, 0.15  # of its commonest pose, a thing stands still there
STILL_SHARE = 0.6  # of the scans at which it must; else it has no place in that session
LEAST_M = 0.4  # smallest thing that counts
ELSEWHERE_M, TURNED_RAD = 0.4, 0.4  # what is off by more stands elsewhere; of a door, has turned
SEEN_BEAMS = 20  # that must have met a thing where it stands for it to be seen
SEEN_SHARE = 0.5  # of a thing's place that the other session must have seen
HIT_M = 0.45  # a listed place this near to a true one is it
_UNCOUNTED = "robot"  # beside people


@dataclass(frozen=True, kw_only=True, eq=False)
class Still:
    """A thing that stood still for most of a session.

    row     in the recording         pose  (x, y, heading) m, m, rad in the world
    points  (n, 2) m, where beams met it there
    """

    row: int
    name: str
    kind: str
    radius_m: float
    pose: tuple[float, float, float]
    points: Float

    def middle(self) -> tuple[float, float]:
        """Of what a beam may meet: of a door, the middle of its leaf."""
        x, y, yaw = self.pose
        if not is_door(self.kind):
            return x, y
        half = 0.5 * self.radius_m
        return x + half * math.cos(yaw), y + half * math.sin(yaw)


def still_things(recording: Recording) -> list[Still]:
    """All movable things and doors that stood still, seen or not."""
    found = []
    sights = [Sight(recording, k).points for k in range(len(recording.frames))]
    for row, kind in enumerate(recording.kinds):
        if kind == _UNCOUNTED or kind.startswith("person"):
            continue
        pose = np.median(recording.poses[:, row], axis=0)
        off = recording.poses[:, row] - pose
        near = np.hypot(off[:, 0], off[:, 1]) < STILL_M
        near &= np.abs(np.array([se2.wrap(a) for a in off[:, 2]])) < STILL_RAD
        if near.mean() >= STILL_SHARE:
            x, y, yaw = pose.tolist()
            found.append(
                Still(
                    row=row,
                    name=recording.names[row],
                    kind=kind,
                    radius_m=float(recording.radii_m[row]),
                    pose=(x, y, yaw),
                    points=_met(recording, row, sights, np.flatnonzero(near).tolist()),
                )
            )
    return found


def _met(recording: Recording, row: int, sights: Sequence[Float], scans: Sequence[int]) -> Float:
    """(n, 2) m, where beams of those scans met a mover."""
    parts = [np.zeros((0, 2))]
    for k in scans:
        hit = recording.hit[k] == row
        if hit.any():
            points = sights[k][hit]
            parts.append(points[np.isfinite(points).all(axis=1)])
    return np.concatenate(parts)


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A place that changed: something came or went; ``seen`` in both sessions."""

    at: tuple[float, float]
    name: str
    came: bool
    seen: bool


def changed_spots(
    first: Recording,
    second: Recording,
    snapshots: tuple[Snapshot, Snapshot],
    cell_m: float,
    T_map_world: Float,
) -> list[Spot]:
    """In the map's frame. A place that another thing has taken over has not changed."""
    things = {t.name: t for t in still_things(first)}, {t.name: t for t in still_things(second)}
    found = []
    for here, other, came in ((0, 1, False), (1, 0, True)):
        for name, thing in things[here].items():
            later = things[other].get(name)
            size = thing.radius_m if is_door(thing.kind) else 2.0 * thing.radius_m
            if size < LEAST_M or (later is not None and not _elsewhere(thing, later)):
                continue
            if name not in things[other] and _restless(name, second if here == 0 else first):
                continue  # it has no place in the other session: nothing can be said
            if any(_covers(rest, thing) for rest in things[other].values() if rest.name != name):
                continue
            at = se2.transform(T_map_world, np.array([thing.middle()]))[0]
            seen = len(thing.points) >= SEEN_BEAMS
            seen &= _seen_share(snapshots[other], at, 0.5 * size, cell_m) >= SEEN_SHARE
            found.append(Spot(at=(float(at[0]), float(at[1])), name=name, came=came, seen=seen))
    return found


def _restless(name: str, recording: Recording) -> bool:
    """Whether it is there and did not stand still."""
    return name in recording.names and bool(
        np.abs(recording.poses[0, recording.names.index(name), :2]).max() < 500.0
    )


def _elsewhere(one: Still, other: Still) -> bool:
    if is_door(one.kind):
        return abs(se2.wrap(one.pose[2] - other.pose[2])) > TURNED_RAD
    return math.dist(one.pose[:2], other.pose[:2]) > ELSEWHERE_M


def _covers(one: Still, spot: Still) -> bool:
    return math.dist(one.middle(), spot.middle()) < one.radius_m + 0.5 * spot.radius_m


def _seen_share(snapshot: Snapshot, at: Float, radius_m: float, cell_m: float) -> float:
    """Of the places within a disc, those that a session has a say on."""
    if not len(snapshot.cells):
        return 0.0
    low, images = dense(snapshot.cells, snapshot.standing)
    n = max(1, math.ceil(radius_m / cell_m))
    i, j = (np.floor(at / cell_m).astype(int) - low).tolist()
    height, width = images[0].shape
    known = 0
    total = 0
    for dj in range(-n, n + 1):
        for di in range(-n, n + 1):
            if di * di + dj * dj > n * n:
                continue
            total += 1
            row, column = j + dj, i + di
            if 0 <= row < height and 0 <= column < width:
                known += not np.isnan(images[0][row, column])
    return known / total


@dataclass(frozen=True, kw_only=True)
class ChangeScore:
    """Counts of places.

    listed, right  that the list has, and of these the true ones
    seen, told     true ones that both sessions saw, and of these those that the list has
    off_m          of each right one, m from the true place
    """

    listed: int
    right: int
    seen: int
    told: int
    off_m: tuple[float, ...]


def scored(
    changes: Sequence[Change], truth: Sequence[Spot], least_m: float = LEAST_M
) -> ChangeScore:
    """Of the listed places of things of ``least_m`` and more; all of them may tell a true one.

    A door counts by its hinge's side: its leaf's two places lie within its length of the hinge.
    """
    right = listed = 0
    off: list[float] = []
    told: set[tuple[float, float]] = set()
    for change in changes:
        reach = HIT_M + (change.size_m if change.kind == "door" else 0.0)
        for spot in change.spots():
            near = [t for t in truth if math.dist(t.at, spot) < reach]
            told.update(t.at for t in near)
            if change.size_m >= least_m:
                listed += 1
                right += bool(near)
                if near and change.kind != "door":
                    off.append(min(math.dist(t.at, spot) for t in near))
    seen = [t for t in truth if t.seen]
    return ChangeScore(
        listed=listed,
        right=right,
        seen=len(seen),
        told=sum(t.at in told for t in seen),
        off_m=tuple(off),
    )
