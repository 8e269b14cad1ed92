# SPDX-License-Identifier: Apache-2.0
"""What truly changed between two simulated sessions, and how much of it a list of changes tells.

A listed place is right if anything came to it or went from it: also a small thing, a person who
stood there, a door that stood otherwise while it was seen, or a thing in whose place another one
stands. Recall asks for less: things of ``LEAST_M`` that stood still for most of the session, were
met by beams, and whose place the other session saw.
"""

import math
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenes.kinds import is_door
from scripts.comparison.maps import Sight
from scripts.comparison.recording import Recording
from scripts.comparison.schema import OLD as AGES
from scripts.comparison.tables import Row
from slam import se2
from slam.days.changes import Change
from slam.days.evidence import Snapshot
from slam.days.history import dense
from slam.estimate import Estimate
from slam.frames import NS_PER_S, Float
from slam.tracker.belief.state import State

STILL_M, STILL_RAD = 0.1, 0.15  # of its commonest pose, a thing stands still there
STILL_SHARE = 0.6  # of the scans at which it must; else it has no place in that session
LONGER = 0.5  # share of scans, or of beams: a thing that stood there for so much longer has changed
REST_SHARE = 0.05  # of the scans: shorter, and it only came past
LEAST_M = 0.4  # smallest thing that is asked for
ELSEWHERE_M, TURNED_RAD = 0.4, 0.4  # what is off by more stands elsewhere; of a door, has turned
SHIFTED_M, SHIFTED_RAD = 0.15, 0.15  # what is off by more may be listed, but need not
SEEN_BEAMS = 20  # that must have met a thing where it stands for it to be seen
SEEN_SHARE = 0.5  # of a thing's place that the other session must have seen
HIT_M = 0.45  # a listed place this near to a true one is it
_OUTSIDE_M = 500.0  # what is out of the building lies farther away
_UNCOUNTED = "robot"
NEWS_S = 2.0  # after which the map has learnt what it saw
CLEARLY, HARDLY = 0.1, 0.01  # share of a scan's beams that what changed has met or let pass
AGE_COLUMNS = ("slam", "age", "session", "found_after_s", "place", "rmse_m", "worst_m", "tracked")


@dataclass(frozen=True, kw_only=True, eq=False)
class Still:
    """A thing, and where it stood still.

    row     in the recording         pose  (x, y, heading) m, m, rad in the world
    share   of the scans at which it stood there; ``met``: of the beams that met it
    points  (n, 2) m, where beams met it there
    """

    row: int
    name: str
    kind: str
    radius_m: float
    pose: tuple[float, float, float]
    share: float
    met: float
    points: Float

    def middle(self) -> tuple[float, float]:
        """Of what a beam may meet: of a door, the middle of its leaf."""
        x, y, yaw = self.pose
        half = 0.5 * self.radius_m if self.door else 0.0
        return x + half * math.cos(yaw), y + half * math.sin(yaw)

    @property
    def door(self) -> bool:
        """Whether it is one."""
        return is_door(self.kind)

    @property
    def size_m(self) -> float:
        """Width of a door's leaf, diameter of anything else."""
        return self.radius_m if self.door else 2.0 * self.radius_m


def still_things(recording: Recording) -> list[Still]:
    """All things, doors and people in the building that stood still for most of the session."""
    return [thing for thing in rests(recording) if thing.share >= STILL_SHARE]


def rests(recording: Recording) -> list[Still]:
    """Every place where one of them stood still for a while, seen or not; its commonest first."""
    found = []
    sights = [Sight(recording, k).points for k in range(len(recording.frames))]
    for row, kind in enumerate(recording.kinds):
        if kind == _UNCOUNTED:
            continue
        beams = (recording.hit == row).sum(axis=1)
        for pose, near in _stays(recording.poses[:, row]):
            if np.abs(pose[:2]).max() > _OUTSIDE_M:
                continue
            x, y, yaw = pose.tolist()
            found.append(
                Still(
                    row=row,
                    name=recording.names[row],
                    kind=kind,
                    radius_m=float(recording.radii_m[row]),
                    pose=(x, y, yaw),
                    share=float(near.mean()),
                    met=float(beams[near].sum() / max(beams.sum(), 1)),
                    points=_met(recording, row, sights, np.flatnonzero(near).tolist()),
                )
            )
    return found


def stands_there(thing: Still, pose: Float) -> bool:
    """Whether it stands still where it did; of a door, whether its leaf is there."""
    turned = abs(se2.wrap(float(pose[2]) - thing.pose[2])) if thing.door else 0.0
    return math.dist(pose[:2].tolist(), thing.pose[:2]) < STILL_M and turned < STILL_RAD


def _stays(poses: Float) -> list[tuple[Float, NDArray[np.bool_]]]:
    """Poses of (n, 3) that one thing keeps in ``REST_SHARE`` of them, and in which of them."""
    found = []
    left = np.ones(len(poses), bool)
    pose = np.median(poses, axis=0)
    while left.any():
        off = poses - pose
        turned = np.mod(off[:, 2] + math.pi, 2.0 * math.pi) - math.pi
        near = left & (np.hypot(off[:, 0], off[:, 1]) < STILL_M) & (np.abs(turned) < STILL_RAD)
        if near.mean() >= REST_SHARE:
            found.append((pose, near))
        left &= ~near
        pose = poses[int(np.argmax(left))]
    return found


def _met(recording: Recording, row: int, sights: Sequence[Float], scans: Sequence[int]) -> Float:
    """(n, 2) m, where beams of those scans met a mover."""
    met = (sights[k][recording.hit[k] == row] for k in scans)
    points = np.concatenate([np.zeros((0, 2)), *met])
    return np.asarray(points[np.isfinite(points).all(axis=1)])


@dataclass(frozen=True, kw_only=True)
class Spot:
    """A place that changed: something came or went.

    asked   of ``LEAST_M``, clearly elsewhere, and nothing else has taken its place
    seen    met by beams in the one session, and its place looked at in the other
    """

    at: tuple[float, float]
    name: str
    came: bool
    seen: bool
    asked: bool = True
    door: bool = False


def changed_spots(
    first: Recording,
    second: Recording,
    snapshots: tuple[Snapshot, Snapshot],
    cell_m: float,
    T_map_world: Float,
) -> list[Spot]:
    """In the map's frame."""
    places = rests(first), rests(second)
    recordings = first, second
    found = []
    for here, other, came in ((0, 1, False), (1, 0, True)):
        for thing in places[here]:
            later = [t for t in places[other] if t.name == thing.name]
            if any(_same(thing, t) for t in later):
                continue
            at = se2.transform(T_map_world, np.array([thing.middle()]))[0]
            seen = len(thing.points) >= SEEN_BEAMS
            seen &= _seen_share(snapshots[other], at, 0.5 * thing.size_m, cell_m) >= SEEN_SHARE
            rest = [t for t in places[other] if t.name != thing.name and t.share >= STILL_SHARE]
            asked = thing.size_m >= LEAST_M and not any(
                math.dist(one.middle(), thing.middle()) < one.radius_m + 0.5 * thing.radius_m
                for one in rest
            )
            asked &= thing.share >= STILL_SHARE
            if later:
                asked &= later[0].share >= STILL_SHARE
                asked &= _elsewhere(thing, later[0], ELSEWHERE_M, TURNED_RAD)
            elif _inside(thing.name, recordings[other]):
                asked = False  # it was about, and may have been in its place for a while
            x, y = at.tolist()
            told = {"came": came, "seen": seen, "asked": asked, "door": thing.door}
            found.append(Spot(at=(x, y), name=thing.name, **told))
    return found


def moved_since(thing: Still, others: Sequence[Still]) -> bool:
    """Whether it does not stand among the things of another session as it stands here."""
    return not any(
        t.name == thing.name and not _elsewhere(thing, t, ELSEWHERE_M, TURNED_RAD) for t in others
    )


def _same(one: Still, other: Still) -> bool:
    """Whether a thing stood there in both sessions, for about as long as it was seen."""
    there = not _elsewhere(one, other, SHIFTED_M, SHIFTED_RAD)
    return there and max(abs(one.share - other.share), abs(one.met - other.met)) < LONGER


def _inside(name: str, recording: Recording) -> bool:
    """Whether it was in the building at the start."""
    if name not in recording.names:
        return False
    start = recording.poses[0, recording.names.index(name), :2]
    return bool(np.abs(start).max() < _OUTSIDE_M)


def _elsewhere(one: Still, other: Still, least_m: float, least_rad: float) -> bool:
    if one.door and abs(se2.wrap(one.pose[2] - other.pose[2])) > least_rad:
        return True
    return math.dist(one.pose[:2], other.pose[:2]) > least_m


def _seen_share(snapshot: Snapshot, at: Float, radius_m: float, cell_m: float) -> float:
    """Of the places within a disc, those that a session has a say on."""
    if not len(snapshot.cells):
        return 0.0
    low, images = dense(snapshot.cells, snapshot.standing)
    n = max(1, math.ceil(radius_m / cell_m))
    x, y = np.mgrid[-n : n + 1, -n : n + 1].reshape(2, -1)
    disc = np.stack([x, y], axis=1)[x * x + y * y <= n * n]
    cells = np.floor(at / cell_m).astype(int) + disc - low
    inside = ((cells >= 0) & (cells < images.shape[:0:-1])).all(axis=1)
    known = ~np.isnan(images[0][cells[inside, 1], cells[inside, 0]])
    return float(known.sum()) / len(disc)


@dataclass(frozen=True, kw_only=True)
class ChangeScore:
    """Counts of places.

    listed, right  that the list has, and of these the true ones
    seen, told     true ones that are asked for and were seen, and of these those that the list has
    doors          (listed as a door, of these truly one door before and after)
    moved          (listed as moved, of these truly one thing before and after)
    off_m          of each right one, m from the true place
    """

    listed: int
    right: int
    seen: int
    told: int
    doors: tuple[int, int]
    moved: tuple[int, int]
    off_m: tuple[float, ...]


def scored(changes: Sequence[Change], truth: Sequence[Spot]) -> ChangeScore:
    """Of all listed places, whatever their size: what a scan meets of a chair may be its column."""
    off: list[float] = []
    told: set[tuple[float, float]] = set()
    named: dict[str, list[bool]] = {"door": [], "moved": []}
    for change in changes:
        near = [[t for t in truth if math.dist(t.at, spot) < HIT_M] for spot in change.places]
        told.update(t.at for some in near for t in some)
        for spot, some in zip(change.places, near, strict=True):
            off += [min(math.dist(t.at, spot) for t in some)] if some else []
        if change.kind in named:
            named[change.kind].append(_is_one(near[0], near[1], door=change.kind == "door"))
    seen = [t for t in truth if t.asked and t.seen]
    return ChangeScore(
        listed=sum(len(change.places) for change in changes),
        right=len(off),
        seen=len(seen),
        told=sum(t.at in told for t in seen),
        doors=(len(named["door"]), sum(named["door"])),
        moved=(len(named["moved"]), sum(named["moved"])),
        off_m=tuple(off),
    )


def _is_one(before: Sequence[Spot], after: Sequence[Spot], *, door: bool) -> bool:
    """Whether the same thing went from one place and came to the other."""
    went = {t.name for t in before if not t.came and t.door == door}
    return bool(went & {t.name for t in after if t.came and t.door == door})


def keep_copy(map_file: Path, folder: Path, number: int) -> Path:
    """The map as it is after that session."""
    folder.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copyfile(map_file, folder / f"{map_file.stem}_{number}.npz"))


def ages_of(copies: Sequence[int], number: int) -> Iterator[tuple[int, int]]:
    """(age, session after which the map was kept) for a session of that number, of ``AGES``.

    A map that is kept apart from a session is missing: the one before is older than its age says.
    """
    for age in AGES:
        before = [k for k in copies if k <= number - age]
        if number - age >= 0 and before:
            yield age, max(before)


def changed_share(before: Recording, now: Recording) -> Float:
    """(scans,) share of the beams with a return that met a thing where it did not stand in the
    session ``before``, or passed through the place that one has left; each while it is news, for
    ``NEWS_S`` from its first beam on. Then the map has learnt it.
    """
    old, new = still_things(before), still_things(now)
    came = [thing for thing in new if moved_since(thing, old)]
    went = [thing for thing in old if moved_since(thing, new)]
    first_ns: dict[int, int] = {}
    shares = np.zeros(len(now.frames))
    for k, frame in enumerate(now.frames):
        sight = Sight(now, k)
        returned: NDArray[np.bool_] = np.asarray(np.isfinite(sight.points).all(axis=1))
        news: NDArray[np.bool_] = np.zeros(len(returned), dtype=np.bool_)
        beams = [now.hit[k] == t.row for t in came] + [_passed(sight, t) for t in went]
        for number, met in enumerate(beams):
            if met.any():
                since = first_ns.setdefault(number, frame.stamp_ns)
                if frame.stamp_ns - since <= NEWS_S * NS_PER_S:
                    news = news | (met & returned)
        shares[k] = news.sum() / max(returned.sum(), 1)
    return shares


def _passed(sight: Sight, thing: Still) -> NDArray[np.bool_]:
    """(beams,) which went through where a thing stood, and beyond."""
    away = sight.points - sight.eye
    length = np.hypot(away[:, 0], away[:, 1])
    to = np.array(thing.middle()) - sight.eye
    radius = 0.5 * thing.size_m
    with np.errstate(invalid="ignore", divide="ignore"):
        along = away @ to / length
        aside = np.abs(away[:, 0] * to[1] - away[:, 1] * to[0]) / length
        met = (aside < radius) & (along > 0.0) & (length > math.hypot(*to) + radius)
    return np.asarray(met, dtype=np.bool_)


def verdicts(estimates: Sequence[Estimate], shares: Float, first: int) -> Row:
    """From scan ``first`` on: how often "map outdated here" is said where the room clearly changed,
    and where it hardly did; None without such scans.
    """
    said = np.array([e.diagnostics.get("state") == State.OUTDATED for e in estimates])[first:]
    shares = shares[first:]
    clearly, hardly = shares >= CLEARLY, shares < HARDLY
    return {
        "outdated_told": float(said[clearly].mean()) if clearly.any() else None,
        "outdated_false": float(said[hardly].mean()) if hardly.any() else None,
    }
