# SPDX-License-Identifier: Apache-2.0
"""What happened in a run: which chair was pushed when, which door swung, who came near the robot.

watch = EventWatch(simulation.world)
for moment in toured(simulation, 60.0):
    watch.note(moment)
watch.events()
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sim.actors.rearranging import is_out
from sim.moments import Moment
from sim.world.world import World
from slam import se2
from slam.frames import NS_PER_S, BeamLabels, Float, Frame

MIN_SHIFT_M = 0.05  # what moves less than that has not been moved; for a door, its rim
JOIN_S = 0.5  # rests shorter than that do not end an event
NEAR_M = 1.5  # a person nearer than that is near the robot, centre to centre
JUMP_M = 0.5  # the truth leaps by that against odometry between two frames: kidnapped
CHAIR, DOOR, PERSON, CHANGE, KIDNAP = "chair", "door", "person", "change", "kidnap"
_KIND = {"door": DOOR, "person": PERSON}  # by group; all else that moves is pushed like a chair


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened.

    kind     "chair" (or another thing that is pushed), "door", "person" (near the robot),
             "change" (it was put elsewhere out of sight), "kidnap"
    name     of the mover, "" for a kidnap
    start_s, end_s  s since the first frame
    seen     whether a beam hit it meanwhile; False for frames without labels
    """

    kind: str
    name: str
    start_s: float
    end_s: float
    seen: bool = False


@dataclass(eq=False)
class _Mover:
    """One thing's latest stirring, an event once it has come far enough."""

    kind: str
    name: str
    radius: float
    rest: list[float] | None = None
    open: Event | None = None
    far: bool = False
    done: list[Event] = field(default_factory=list)

    def close(self) -> None:
        """The stirring is over."""
        if self.open is not None and self.far:
            self.done.append(self.open)
        self.open, self.rest, self.far = None, None, False


class EventWatch:
    """Collects the events of one world, moment by moment."""

    def __init__(self, world: World) -> None:
        movers = world.scene.movers
        self._mover_of_body = world.bodies.mover_of_body
        self._movers = [
            None if m.group == "robot" else _Mover(_KIND.get(m.group, CHAIR), m.name, m.radius)
            for m in movers
        ]
        self._people = np.array([m.group == "person" for m in movers], dtype=bool)
        self._kidnaps: list[Event] = []
        self._changes: list[Event] | None = [] if world.change else None
        self._bounds = world.scene.bounds
        self._first_ns: int | None = None
        self._last: Frame | None = None

    @property
    def kinds(self) -> list[str]:
        """Kinds of events that this world can have."""
        there = {m.kind for m in self._movers if m is not None}
        there |= set() if self._changes is None else {CHANGE}
        return [kind for kind in (CHAIR, DOOR, PERSON, CHANGE) if kind in there]

    def note(self, moment: Moment) -> None:
        """Take in the next moment."""
        frame = moment.frame
        self._first_ns = frame.stamp_ns if self._first_ns is None else self._first_ns
        seconds = (frame.stamp_ns - self._first_ns) / NS_PER_S
        seen = self._seen(frame.labels)
        stirs = np.where(self._people, self._near(moment), moment.moving)
        changed = {event.name for event in moment.rearranged}
        for row, mover in enumerate(self._movers):
            if mover is not None and mover.name in changed:
                mover.close()
                self._change(mover.name, seconds)
            elif mover is not None and not is_out(moment.poses[row], self._bounds):
                self._update(mover, moment.poses[row], bool(stirs[row]), bool(seen[row]), seconds)
        if self._last is not None and _leapt(self._last, frame):
            self._kidnaps.append(Event(kind=KIDNAP, name="", start_s=seconds, end_s=seconds))
        self._last = frame

    def events(self) -> list[Event]:
        """All so far in the order of their beginnings; those still going on end now."""
        found = [*self._kidnaps, *(self._changes or ())]
        for mover in self._movers:
            if mover is not None:
                found += mover.done
                if mover.open is not None and mover.far:
                    found.append(mover.open)
        return sorted(found, key=lambda event: (event.start_s, event.kind, event.name))

    def _change(self, name: str, seconds: float) -> None:
        """It stands elsewhere at once."""
        if self._changes is not None:
            self._changes.append(Event(kind=CHANGE, name=name, start_s=seconds, end_s=seconds))

    def _seen(self, labels: BeamLabels | None) -> NDArray[np.bool_]:
        """(movers,) whether a beam of this scan hit each."""
        seen = np.zeros(len(self._movers), dtype=bool)
        if labels is not None:
            hit = self._mover_of_body[labels.body[labels.body >= 0]]
            seen[hit[hit >= 0]] = True
        return seen

    def _near(self, moment: Moment) -> NDArray[np.bool_]:
        """(movers,) whether each is near the robot."""
        if moment.frame.truth is None:
            return np.zeros(len(self._movers), dtype=bool)
        offset = moment.poses[:, :2] - moment.frame.truth[:2]
        near: NDArray[np.bool_] = (offset * offset).sum(axis=1) < NEAR_M * NEAR_M
        return near

    @staticmethod
    def _update(mover: _Mover, pose: Float, stirs: bool, seen: bool, seconds: float) -> None:
        if not stirs:
            if mover.open is not None and seconds - mover.open.end_s > JOIN_S:
                mover.close()
            return
        if mover.open is None:
            mover.open = Event(kind=mover.kind, name=mover.name, start_s=seconds, end_s=seconds)
            mover.rest, mover.far = pose.tolist(), mover.kind == PERSON
        mover.open = replace(mover.open, end_s=seconds, seen=mover.open.seen or seen)
        mover.far = mover.far or _shift(mover, pose) >= MIN_SHIFT_M


def _shift(mover: _Mover, pose: Float) -> float:
    """m from where it rested; of a door's rim."""
    assert mover.rest is not None
    x, y, yaw = mover.rest
    if mover.kind == DOOR:
        turned = abs(se2.wrap(float(pose[2]) - yaw)) * mover.radius
        return max(turned, math.hypot(float(pose[0]) - x, float(pose[1]) - y))
    return math.hypot(float(pose[0]) - x, float(pose[1]) - y)


def _leapt(before: Frame, now: Frame) -> bool:
    """Whether the truth moved otherwise than any wheel could."""
    if before.truth is None or now.truth is None:
        return False
    true = se2.between(before.truth, now.truth)
    rolled = se2.between(before.odometry.T_odom_robot, now.odometry.T_odom_robot)
    return math.hypot(true[0] - rolled[0], true[1] - rolled[1]) > JUMP_M
