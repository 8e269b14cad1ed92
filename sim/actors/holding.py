# SPDX-License-Identifier: Apache-2.0
"""Hands: what is pushed, pulled or carried is held by a bounded spring and damper.

What the hand does to the thing, the thing does to the hand: who pushes a heavy bed into a wall is
stopped by it. The torque of two hands is taken up by the feet. Forces are generalised forces of
planar joints (x, y, yaw), written before each substep.
"""

import math
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Scene
from sim.actors.config import HOLD
from sim.core.bodies import Bodies
from sim.core.state import Records, record
from slam._jit import inner
from slam.frames import Float

Int = NDArray[np.int64]
# First qpos and dof of the holder, then of what is held, -1: an empty hand; first dof of what has
# just been put down, or -1.
HANDS = record(np.int64, "qa va qb vb dropped")


class Held(NamedTuple):
    """h holds.

    at      (h,) of ``HANDS``
    pose    (h, 3) of what is held in the holder's frame: x m, y m, yaw rad
    hinged  (h,) whether it turns freely about the middle of the holder
    bodies  (h, 2) mass kg and yaw inertia kg m2 of what is held
    """

    at: Records
    pose: Float
    hinged: NDArray[np.bool_]
    bodies: Float


@inner
def hold(held: Held | None, qpos: Float, qvel: Float, qfrc: Float) -> None:
    """Write the forces of all hands into ``qfrc``."""
    if held is None:
        return
    for k in range(len(held.at)):
        hand = held.at[k]
        for axis in range(3 if hand.dropped >= 0 else 0):
            qfrc[hand.dropped + axis] = 0.0
            qfrc[hand.va + axis] = 0.0
        hand.dropped = -1
        for axis in range(3 if hand.qb >= 0 else 0):
            qfrc[hand.va + axis] = 0.0
            qfrc[hand.vb + axis] = 0.0
    for k in range(len(held.at)):
        hand = held.at[k]
        qa, va, qb, vb = hand.qa, hand.va, hand.qb, hand.vb
        if qb < 0:
            continue
        c, s = math.cos(qpos[qa + 2]), math.sin(qpos[qa + 2])
        arm, bx, by = held.pose[k, 0], 0.0, 0.0
        rx, ry = c * arm - s * held.pose[k, 1], s * arm + c * held.pose[k, 1]
        if held.hinged[k]:  # it turns about the middle of the holder, who turns as freely
            rx = ry = 0.0
            bx, by = -math.cos(qpos[qb + 2]) * arm, -math.sin(qpos[qb + 2]) * arm
        ex, ey = qpos[qa] + rx - qpos[qb] - bx, qpos[qa + 1] + ry - qpos[qb + 1] - by
        if ex * ex + ey * ey > HOLD.lost_m * HOLD.lost_m:
            continue
        wa, wb = qvel[va + 2], qvel[vb + 2]
        du = qvel[va] - wa * ry - qvel[vb] + wb * by
        dv = qvel[va + 1] + wa * rx - qvel[vb + 1] - wb * bx
        mass, inertia = held.bodies[k]
        fx = mass * (HOLD.stiffness * ex + HOLD.damping * du)
        fy = mass * (HOLD.stiffness * ey + HOLD.damping * dv)
        size = math.sqrt(fx * fx + fy * fy)
        over = max(size / HOLD.force_max, 1.0)
        fx, fy, torque = fx / over, fy / over, 0.0
        if not held.hinged[k]:
            turn = qpos[qa + 2] + held.pose[k, 2] - qpos[qb + 2]
            turn -= 2.0 * math.pi * math.floor((turn + math.pi) / (2.0 * math.pi))
            torque = inertia * (HOLD.stiffness * turn + HOLD.damping * (wa - wb))
            torque = min(max(torque, -HOLD.torque_max), HOLD.torque_max)
        qfrc[vb] += fx
        qfrc[vb + 1] += fy
        qfrc[vb + 2] += torque + bx * fy - by * fx
        qfrc[va] -= fx
        qfrc[va + 1] -= fy


def hands(model: mujoco.MjModel, bodies: Bodies, scene: Scene, cleaners: list[str]) -> Held:
    """The holds of a scene, then the empty hands of those who take chairs along."""
    n = len(scene.holds) + len(cleaners)
    at, pose = np.full(n, -1, HANDS), np.zeros((n, 3))
    hinged, inertia = np.zeros(n, dtype=np.bool_), np.ones((n, 2))
    for k, each in enumerate(scene.holds):
        qpos, dof = bodies.addresses([each.holder, each.held])
        at[k] = qpos[0], dof[0], qpos[1], dof[1], -1
        pose[k], hinged[k] = each.pose, each.hinged
        body = model.body(f"{each.held}/base")
        inertia[k] = body.mass[0], body.inertia[2]
    for k, name in enumerate(cleaners):
        qpos, dof = bodies.addresses([name])
        at[len(scene.holds) + k] = qpos[0], dof[0], -1, -1, -1
    return Held(at, pose, hinged, inertia)
