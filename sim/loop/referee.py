# SPDX-License-Identifier: Apache-2.0
"""What truly happened: collisions, near misses, goals taken by others. Steers nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sim.core.contacts import Contact
from sim.world.world import World
from slam.frames import NS_PER_S, Float

APART_S = 1.0  # touching the same thing again within this is the same collision
CLEAR_M = 0.4  # a near miss is over when the person is this far again


@dataclass
class Tally:
    """Counted from one moment to another.

    by_robot, by_others  collisions, by whose motion closed the gap
    near_misses          people who came near without a touch
    touched              names of what was touched, in order
    """

    by_robot: int = 0
    by_others: int = 0
    near_misses: int = 0
    touched: list[str] = field(default_factory=list)


class Referee:
    """Watches a world, one scan at a time."""

    def __init__(self, world: World, near_m: float) -> None:
        self._world, self._near_m = world, near_m
        movers = world.scene.movers
        self._row = {m.name: k for k, m in enumerate(movers)}
        self._people = [k for k, m in enumerate(movers) if m.group == "person"]
        self._radii = np.array([m.radius for m in movers])
        self._poses = self._before = world.mover_poses()
        self._last_ns: dict[str, int] = {}
        self._near: dict[int, bool] = {}  # people near now; whether touched
        self.tally = Tally()

    def watch(self, contacts: Sequence[Contact]) -> None:
        """One scan more has passed, during which these were touched."""
        self._before, self._poses, before = self._poses, self._world.mover_poses(), self._before
        now = self._world.time_ns
        for contact in contacts:
            last = self._last_ns.get(contact.name)
            self._last_ns[contact.name] = now
            if last is None or now - last > APART_S * NS_PER_S:
                self.tally.touched.append(contact.name)
                if self._robot_did(contact.name, before):
                    self.tally.by_robot += 1
                else:
                    self.tally.by_others += 1
        self._watch_people({contact.name for contact in contacts})

    def _robot_did(self, name: str, before: Float) -> bool:
        """Whether the robot's motion just before closed the gap more than the other's."""
        row = self._row.get(name)
        if row is None:
            return True
        robot, other = self._before[-1, :2], self._before[row, :2]
        gap = other - robot
        gap = gap / max(math.hypot(gap[0], gap[1]), 1e-9)
        by_robot = float(((robot - before[-1, :2]) * gap).sum())
        by_other = -float(((other - before[row, :2]) * gap).sum())
        if self._world.scene.movers[row].kind == "door":  # its pose is its hinge: it turns
            by_other = abs(float(self._before[row, 2] - before[row, 2])) * float(self._radii[row])
        return by_robot >= by_other

    def _watch_people(self, touched: set[str]) -> None:
        robot, rim = self._poses[-1], self._radii[-1]
        for k in self._people:
            offset = self._poses[k, :2] - robot[:2]
            free = math.hypot(offset[0], offset[1]) - self._radii[k] - rim
            hit = self._world.scene.movers[k].name in touched
            if free < self._near_m or hit:
                self._near[k] = self._near.get(k, False) or hit
            elif k in self._near and free > CLEAR_M:
                self.tally.near_misses += not self._near.pop(k)

    def close(self) -> Tally:
        """The tally up to now, and a new one; whoever is still near counts in the old."""
        for k in [k for k, hit in self._near.items() if not hit]:
            self.tally.near_misses += 1
            self._near[k] = True
        done, self.tally = self.tally, Tally()
        return done

    def taken(self, goal: Float) -> str:
        """What stands on a goal now, too near to it for the robot; "" if nothing does."""
        for mover, pose, radius in zip(
            self._world.scene.movers, self._poses, self._radii, strict=True
        ):
            offset = pose[:2] - goal
            room = math.hypot(offset[0], offset[1]) - radius - self._radii[-1]
            if mover.group not in ("robot", "door") and room < 0.0:
                return mover.name
        return ""
