# SPDX-License-Identifier: Apache-2.0
"""Doors with closers: opened for whoever comes, blown or pushed about at the dynamism rate.

How often a door is opened: ``CURVES`` in ``sim.core.dynamism``.

Sliding doors stay open while anybody stands in them; a lift's opens when the cabin has come.

The closer (spring to the angle of rest, damper) is in the model. A hand, a draught or the opener
for the robot adds a torque through ``qfrc_applied``; at all other times that is exactly zero, so a
door at rest sleeps.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.kinds import joint_of_door
from sim.actors.config import DOORS
from sim.actors.people.columns import PASSAGE
from sim.core.bodies import Bodies
from sim.core.seeds import between, waiting
from sim.core.state import Record, Records, flat, record
from slam._jit import inner
from slam.frames import Float

# next event s, end of the present one s, its angle rad, until when the door is kept open for
# someone s, and when the cabin behind it comes s (inf: uncalled)
SCHEDULE = record(np.float64, "next until angle kept comes")
# N m/rad, N m s/rad, N m, kg m2, rad, most rad/s, sort; of a leaf that slides N, kg and m
CLOSER = record(np.float64, "stiffness damping friction inertia rest rate sort")
SWINGS, SLIDES, LIFT = 0.0, 1.0, 2.0  # sorts of door
# the numbers, as the kernels see them


@inner
def robot_asks(robot: Float, middle: Float) -> bool:
    """Whether the robot (x, y, yaw) comes to, or is in, the doorway around ``middle`` (x, y)."""
    dx, dy = middle[0] - robot[0], middle[1] - robot[1]
    distance = math.sqrt(dx * dx + dy * dy)
    ahead = dx * math.cos(robot[2]) + dy * math.sin(robot[2])
    return distance < DOORS.clear_m or (distance < DOORS.near_m and ahead > DOORS.facing * distance)


@inner
def torque_to(target: float, q: float, qd: float, closer: Record) -> float:
    """N m that turns the leaf to ``target`` at a hand's pace; N for one that slides."""
    rate = min(max(DOORS.rate_gain * (target - q), -closer.rate), closer.rate)
    friction = math.copysign(closer.friction, rate) if abs(rate) > 0.02 else 0.0
    push = closer.stiffness * (q - closer.rest) + closer.damping * rate + friction
    torque = push + DOORS.torque_gain * closer.inertia * (rate - qd)
    return float(min(max(torque, -DOORS.torque_max), DOORS.torque_max) + 0.0)


class Leaves(NamedTuple):
    """The doors of a model, m of them.

    rates      (m,) events that nobody in sight causes, 1/s
    addresses  (m, 2) in qpos and dof; middles (m, 2) m; closers (m,); limits (m, 2) rad
    passage    (m,) of ``sim.actors.people.columns``: what people want
    schedule   (m,); draws (m,) generators
    """

    rates: Float
    addresses: NDArray[np.int64]
    middles: Float
    closers: Records
    limits: Float
    passage: Records
    schedule: Records
    draws: NDArray[np.uint64]


@inner
def kept_open(time: float, lift: bool, asked: bool, inside: bool, q: float, row: Record) -> bool:
    """Whether a sliding door is to stand open now; ``row`` of the schedule is brought up to date.

    A lift that is shut comes some time after it was called, from within or without.
    """
    if not lift:
        if asked or inside:
            row.kept = time + DOORS.slide_held_s
        return bool(time < row.kept)
    if time >= row.comes:
        row.kept, row.comes = time + DOORS.lift_held_s, math.inf
    elif asked and time >= row.kept and q < DOORS.slide_shut_m and row.comes == math.inf:
        row.comes = time + DOORS.lift_s
    elif (asked or inside) and q >= DOORS.slide_shut_m:
        row.kept = max(row.kept, time + DOORS.slide_held_s)
    return bool(time < row.kept)


@inner
def slide_on(time: float, lift: bool, q: float, qd: float, row: Record) -> tuple[float, bool]:
    """Where a sliding door that nobody needs is driven to, and whether it is driven at all.

    A leaf that is stopped by something on its way opens again.
    """
    if time < row.until and not lift:
        return row.angle, True
    if (
        time > max(row.kept, row.until) + DOORS.slide_starts_s
        and q > DOORS.slide_stopped_m
        and abs(qd) < DOORS.slide_still_mps
    ):
        row.kept = time + DOORS.slide_held_s
    return -DOORS.slide_shut_m, q > DOORS.slide_shut_m


@inner
def swing(time: float, robot: Float, leaves: Leaves, physics: tuple[Float, Float, Float]) -> None:
    """One tick of all doors.

    robot    (3,) pose
    physics  qpos and qvel (read), qfrc_applied (written)
    """
    rates, addresses, middles = leaves.rates, leaves.addresses, leaves.middles
    closers, limits, passage = leaves.closers, leaves.limits, leaves.passage
    schedule, draws = leaves.schedule, leaves.draws
    qpos, qvel, qfrc = physics
    for d in range(len(addresses)):
        at, dof = addresses[d]
        row, closer = schedule[d], closers[d]
        low, high = limits[d]
        if time >= row.next:  # always three draws
            row.next = time + waiting(draws, d, rates[d])
            row.angle = between(draws, d, low, high)
            row.until = time + between(draws, d, DOORS.event_least_s, DOORS.event_most_s)
        if closer.sort != SWINGS:
            asked = passage[d].asked > 0.0 or robot_asks(robot, middles[d])
            lift, inside = closer.sort == LIFT, passage[d].inside > 0.0
            target, driven = DOORS.slide_opened * high, True
            if not kept_open(time, lift, asked, inside, qpos[at], row):
                target, driven = slide_on(time, lift, qpos[at], qvel[dof], row)
            qfrc[dof] = torque_to(target, qpos[at], qvel[dof], closer) if driven else 0.0
            continue
        if (
            passage[d].asked > 0.0
            or robot_asks(robot, middles[d])
            or (passage[d].inside > 0.0 and time < row.kept)
        ):
            row.kept = time + DOORS.held_s
        if time < row.kept:
            shut = min(closer.rest, qpos[at]) < DOORS.passable_rad
            disturbed = time < row.until or shut
            target = min(max(DOORS.opened_rad, closer.rest), high)
        elif time < row.until:
            # an angle is not forced upon someone who stands in the doorway
            disturbed, target = True, qpos[at] if passage[d].inside > 0.0 else row.angle
        else:
            disturbed, target = False, 0.0
        qfrc[dof] = torque_to(target, qpos[at], qvel[dof], closer) if disturbed else 0.0


class Doors:
    """The doors of a model, as ``leaves``.

    ``passage`` is shared with the people, who write what they want.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: Bodies,
        names: Sequence[str],
        *,
        rate: float,
        counters: NDArray[np.uint64],
    ) -> None:
        """``rate``: events of each door that nobody in sight causes, 1/s."""
        self.names = list(names)
        m = len(self.names)
        self.passage = np.zeros(m, PASSAGE)
        self.schedule = np.full(m, -math.inf, SCHEDULE)
        self.schedule["comes"] = math.inf
        self._draws = counters.copy()
        qpos, dof = bodies.addresses(self.names)
        self.addresses = np.column_stack([qpos, dof])
        self.hinges = bodies.hinges(self.names)
        self.widths = bodies.radii(self.names)
        heading = self.hinges[:, 2].tolist()
        self.along = np.array([[math.cos(a), math.sin(a)] for a in heading]).reshape(m, 2)
        self.middles = self.hinges[:, :2] + 0.5 * self.widths[:, None] * self.along
        self._closers, self._limits = np.zeros(m, CLOSER), np.zeros((m, 2))
        kinds = {mover.name: mover.kind for mover in bodies.scene.movers}
        for d, name in enumerate(self.names):
            joint = model.joint(f"{name}/{joint_of_door(kinds[name])}")
            pace = DOORS.rate_max, SWINGS
            if kinds[name] != "door":
                pace = DOORS.slide_max, LIFT if kinds[name] == "door_lift" else SLIDES
            closer, self._limits[d] = _closer(model, joint)
            self._closers[d] = *closer, *pace
            self.schedule["next"][d] = waiting(self._draws, d, rate)
        self.leaves = Leaves(
            np.full(m, rate), self.addresses, self.middles, self._closers, self._limits,
            self.passage, self.schedule, self._draws,
        )  # fmt: skip

    def boxes_at_rest(self) -> Float:
        """(m, 5) leaves at about their angle of rest: centre x, y, half sizes m, yaw rad.

        To the nearest ``REST_STEP``, so that rooms that differ only in how wide their doors stand
        open have the same ways through them, which are costly to find.
        """
        boxes = np.zeros((len(self.names), 5))
        for d, (x, y, closed, sign, slides) in enumerate(self.hinges.tolist()):
            if slides != 0.0:  # out of the way, in front of the wall, when somebody comes
                half = 0.5 * float(self.widths[d])
                boxes[d] = (
                    x - half * math.cos(closed),
                    y - half * math.sin(closed),
                    half,
                    0.03,
                    closed,
                )
                continue
            rest = DOORS.rest_step * round(float(self._closers["rest"][d]) / DOORS.rest_step)
            yaw, half = closed + sign * rest, 0.5 * float(self.widths[d])
            boxes[d] = x + half * math.cos(yaw), y + half * math.sin(yaw), half, 0.03, yaw
        return boxes

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The live arrays that are the state."""
        return {
            "passage": flat(self.passage),
            "schedule": flat(self.schedule),
            "draws": self._draws,
        }


def _closer(model: mujoco.MjModel, joint: object) -> tuple[tuple[float, ...], Float]:
    """(stiffness, damping, friction, inertia, rest) and (low, high) of a hinge."""
    j = joint.id  # type: ignore[attr-defined]
    dof, at = int(model.jnt_dofadr[j]), int(model.jnt_qposadr[j])
    low, high = model.jnt_range[j] if model.jnt_limited[j] else (0.0, math.pi / 2.0)
    rest = min(max(float(model.qpos_spring[at]), float(low)), float(high))
    values = (
        np.ravel(model.jnt_stiffness[j])[0],
        np.ravel(model.dof_damping[dof])[0],
        model.dof_frictionloss[dof],
        model.dof_M0[dof],
        rest,
    )
    return values, np.array([low, high], dtype=np.float64)
