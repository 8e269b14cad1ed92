# SPDX-License-Identifier: Apache-2.0
"""Hands from outside: somebody pushes a chair, opens a door or carries the robot away.

Call these between two scans. They draw nothing, so the same call at the same scan gives the same
world, and a world that nobody touches goes on as if they were not there.
"""

import math
from collections.abc import Sequence

import numpy as np

from scenes.assembly import discs_of
from scenes.scene import Mover
from sim.actors.chairs import Shoves
from sim.actors.config import CHAIRS
from sim.actors.doors import SWINGS
from sim.core.flow import box_clearance
from sim.world.substeps import SUBSTEPS_PER_S, SUBSTEPS_PER_TICK
from sim.world.world import World
from slam.errors import InvalidValueError, UnknownNameError

PUSH_TICKS = 15  # 0.2 s, between the shortest and the longest of ``sim.actors.chairs``
MOST_SPEED = 3.0  # m/s, of a push
MOST_HOLD_S = 600.0  # that a door is held open or shut


def pushable(world: World) -> list[str]:
    """Names of what ``push`` can push, in the order of the scene."""
    ours = {n for made in world.shoves.values() if isinstance(made, Shoves) for n in made.names}
    return [name for name in world.mover_names if name in ours]


def push(world: World, name: str, speed: float, heading: float) -> float:
    """Push a chair, bin or load: m/s and rad in the world; the speed it is given, m/s.

    What is heavy gets less: no push is stronger than those of the world's own
    (``sim.actors.chairs``). Raises ``UnknownNameError`` for what cannot be pushed.
    """
    if not (0.0 < speed <= MOST_SPEED and math.isfinite(heading)):
        raise InvalidValueError(
            f"a push must have a speed in (0, {MOST_SPEED:g}] m/s and a finite heading, "
            f"got {speed} m/s and {heading} rad"
        )
    shoves = _shoves_of(world, name)
    row = shoves.names.index(name)
    mass, _, friction, _ = shoves.table.bodies[row].tolist()
    speed = min(speed, CHAIRS.impulse_max / mass)
    dof = int(shoves.table.dofs[row])
    tick = SUBSTEPS_PER_TICK / SUBSTEPS_PER_S
    duration = PUSH_TICKS * tick
    cx, cy = math.cos(heading), math.sin(heading)
    qfrc = world.data.qfrc_applied
    qfrc[dof] = mass * speed * cx / duration + math.copysign(friction, cx)
    qfrc[dof + 1] = mass * speed * cy / duration + math.copysign(friction, cy)
    qfrc[dof + 2] = 0.0
    shoves.schedule[row, 1] = _now_s(world) + duration - 0.5 * tick
    return speed


def _shoves_of(world: World, name: str) -> Shoves:
    for made in world.shoves.values():
        if isinstance(made, Shoves) and name in made.names:
            return made
    known = pushable(world)
    raise UnknownNameError(
        f"nothing called '{name:.80}' can be pushed here, only: {', '.join(known) or 'nothing'}"
    )


def hold_door(world: World, name: str, *, opened: bool, seconds: float) -> None:
    """Hold a door open or shut for so long, s; a lift's comes and goes as if somebody called it.

    A door is not shut on somebody: what stands in it keeps it open, as ever. Raises
    ``UnknownNameError`` for no door.
    """
    if not 0.0 < seconds <= MOST_HOLD_S:
        raise InvalidValueError(f"a door can be held for up to {MOST_HOLD_S:g} s, got {seconds}")
    doors = world.doors
    if name not in doors.names:
        known = ", ".join(doors.names) or "none"
        raise UnknownNameError(f"there is no door '{name:.80}' here, doors: {known}")
    d = doors.names.index(name)
    row, until = doors.schedule[d], _now_s(world) + seconds
    row["kept"] = until if opened else -math.inf
    row["until"] = -math.inf
    if not opened and doors.leaves.closers[d]["sort"] == SWINGS:
        row["until"], row["angle"] = until, float(doors.leaves.limits[d, 0])


def carry(world: World, pose: Sequence[float]) -> None:
    """Carry the robot to (x m, y m, heading rad), where its floor must be free.

    Raises ``InvalidValueError`` that says what is in the way.
    """
    x, y, yaw = (float(value) for value in pose)
    if not math.isfinite(x + y + yaw):
        raise InvalidValueError(f"the robot can be carried to a finite pose only, got {pose}")
    taken = in_the_way(world, x, y)
    if taken:
        raise InvalidValueError(f"the robot cannot stand at ({x:.2f}, {y:.2f}): {taken}")
    world.carry((x, y, yaw))


def walled(world: World, x: float, y: float, radius: float | None = None) -> str:
    """What keeps a disc from ever standing at (x, y) m; "" for nothing. Default the robot's."""
    robot = world.bodies.robot
    if robot is None:
        return "the scene has no robot"
    own = float(world.bodies.radius[robot]) if radius is None else radius
    xmin, ymin, xmax, ymax = world.scene.bounds
    if not (xmin + own <= x <= xmax - own and ymin + own <= y <= ymax - own):
        return f"the floor reaches from ({xmin:g}, {ymin:g}) to ({xmax:g}, {ymax:g})"
    boxes = np.ascontiguousarray(world.scene.obstacles, dtype=np.float64)
    if box_clearance(x, y, boxes) < own:
        return "a wall or furniture is there"
    return ""


def in_the_way(world: World, x: float, y: float, radius: float | None = None) -> str:
    """What keeps a disc, default the robot's, from standing at (x, y) m now; "" for nothing."""
    taken, robot = walled(world, x, y, radius), world.bodies.robot
    if taken or robot is None:
        return taken
    own = float(world.bodies.radius[robot]) if radius is None else radius
    for mover, place in zip(world.scene.movers, world.mover_poses().tolist(), strict=True):
        if mover.group == "robot" and radius is None:
            continue
        if any(math.hypot(u - x, v - y) < far + own for u, v, far in _discs(mover, place)):
            return f"{mover.name} is there"
    return ""


def _discs(mover: Mover, place: Sequence[float]) -> list[tuple[float, float, float]]:
    """(x, y, radius) m of what a mover covers; a leaf is six discs, as for the driver."""
    x, y, yaw = place
    if mover.group == "door":
        steps = [mover.radius * k / 6.0 for k in range(1, 7)]
        return [(x + r * math.cos(yaw), y + r * math.sin(yaw), 0.05) for r in steps]
    return [(x, y, mover.radius)] if mover.group == "robot" else discs_of(mover.kind, place)


def free_goal(world: World, name: str = "") -> tuple[float, float, float]:
    """Pose of a goal of the scene; without a name the farthest from the robot that is free.

    Raises ``UnknownNameError`` for no such goal, ``InvalidValueError`` where none is free.
    """
    goals, here = world.scene.goals, world.robot_pose()
    if name:
        if name not in goals:
            known = ", ".join(goals)
            raise UnknownNameError(f"there is no goal '{name:.80}' here, goals: {known}")
        return (*goals[name], float(here[2]))
    far = sorted(goals.values(), key=lambda at: -math.hypot(at[0] - here[0], at[1] - here[1]))
    for x, y in far:
        if not in_the_way(world, x, y):
            return x, y, float(here[2])
    raise InvalidValueError("none of the scene's goals is free for the robot now")


def nearest(world: World, names: Sequence[str], x: float, y: float) -> tuple[str, float]:
    """Which of these movers is nearest to (x, y) m, and how far, m; ("", inf) of none.

    A door is where the middle of its leaf is.
    """
    best, least = "", math.inf
    poses = world.mover_poses()
    for name in names:
        row = world.mover_names.index(name)
        mover, (px, py, yaw) = world.scene.movers[row], poses[row].tolist()
        half = 0.5 * mover.radius if mover.group == "door" else 0.0
        apart = math.hypot(px + half * math.cos(yaw) - x, py + half * math.sin(yaw) - y)
        if apart < least:
            best, least = name, apart
    return best, least


def _now_s(world: World) -> float:
    return world.step_count / SUBSTEPS_PER_S
