# SPDX-License-Identifier: Apache-2.0
"""Substeps of 1/300 s in one compiled call: physics, actors, the robot's drive, what is noted.

Order of a substep: at every fourth one the drive ramps its wheels; MuJoCo moves everything; the
limbs are posed; before every fourth one the actors decide (people, doors, shoves); then all poses
are made fresh, so that whoever looks between two substeps (a scanner, a film, ``save_state``) sees
poses of that very instant, and forces that will act from it on.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.actors.chairs import Shoved, shove
from sim.actors.doors import Leaves, swing
from sim.actors.holding import hold
from sim.actors.people.crowd import People, decide
from sim.actors.people.gait import walk
from sim.actors.people.trips import dress
from sim.actors.robot import ramp, roll
from sim.actors.rolling import Rolled
from sim.actors.rolling import roll as roll_chairs
from sim.core.contacts import Touches, collect
from sim.core.engine import Engine, call
from sim.core.state import Records
from sim.sensors.lidar.windows import Noted, note
from slam._jit import inner, uncounted
from slam.frames import Float

SUBSTEPS_PER_S = 300
SUBSTEPS_PER_TICK = 4  # 13.33 ms: the control period of the actors and of the drive


class Physics(NamedTuple):
    """Arrays of the model's data: state, controls, applied forces, mocap poses."""

    qpos: Float
    qvel: Float
    ctrl: Float
    qfrc: Float
    mocap: tuple[Float, Float]


class Robot(NamedTuple):
    """The robot in the arrays of the engine.

    at         first qpos and first dof
    push       ``qfrc_constraint``: anything but 0 at the robot's dofs is a touch
    touches    where these are collected
    drive      (1,) state, see ``sim.actors.robot``; tyres  (2,) actuators left, right
    limits     (4,) of ``sim.actors.robot.Drive``
    """

    at: tuple[int, int]
    push: Float
    touches: Touches
    drive: Records
    tyres: NDArray[np.int64]
    limits: Float


class Pinned(NamedTuple):
    """What is held where it is whatever acts on it (``sim.twins.absence``); nothing in a plain run.

    at, places  qpos addresses and what stands there; dofs; servos  actuators
    """

    at: NDArray[np.int64]
    places: Float
    dofs: NDArray[np.int64]
    servos: NDArray[np.int64]


class Actors(NamedTuple):
    """Everybody who moves anything, and what may not."""

    people: People
    doors: Leaves
    shoved: tuple[Shoved, Shoved, Shoved]
    rolled: tuple[Rolled, Rolled, Rolled]
    pinned: Pinned


class Room(NamedTuple):
    """All that a substep reads and writes; clock (1,) substeps made since the start."""

    clock: NDArray[np.int64]
    engine: Engine
    robot: Robot
    physics: Physics
    actors: Actors


class Watch(NamedTuple):
    """What is written down after each substep k: row k of all, longer than a scan where need be.

    marks    (n,) whether the scanner notes all poses
    scanner  where to, a ``sim.sensors.lidar.windows.Noted``
    path     (n, 3) pose of the robot; travel (n, 3) m rolled by the wheels, and to the left
    """

    marks: NDArray[np.bool_]
    scanner: Noted
    path: Float
    travel: Float


@inner
def control(time: float, robot: Robot, physics: Physics, actors: Actors) -> None:
    """Let everybody but the robot decide for the next tick."""
    people, doors = actors.people, actors.doors
    qpos, qvel, qfrc = physics.qpos, physics.qvel, physics.qfrc
    tick = SUBSTEPS_PER_TICK / SUBSTEPS_PER_S
    if people.alive:
        decide((time, tick), (qpos, qvel, physics.ctrl), people)
        dress(people.crowd, people.hulls)
    pose = qpos[robot.at[0] : robot.at[0] + 3]
    swing(time, pose, doors, (qpos, qvel, qfrc))
    for shoved in actors.shoved:
        shove(time, tick, shoved, qfrc)
    for rolled in actors.rolled:
        roll_chairs(time, tick, rolled, qvel, qfrc)


@inner
def pin(physics: Physics, pinned: Pinned) -> None:
    """Undo what moved the pinned things, or would."""
    for k in range(len(pinned.at)):
        physics.qpos[pinned.at[k]] = pinned.places[k]
    for dof in pinned.dofs:
        physics.qvel[dof] = 0.0
        physics.qfrc[dof] = 0.0
    for servo in pinned.servos:
        physics.ctrl[servo] = 0.0


@uncounted
def advance(first: int, last: int, resumed: bool, room: Any, watch: Any) -> int:  # noqa: C901 (kernel)
    """Make the substeps that end at rows ``first + 1`` to ``last`` of ``watch``.

    Returns the last row. At the robot's first touch it returns early, with the row before, as it
    does not know yet where contacts are: find out, then call it again from that row, ``resumed``.
    With ``last`` < ``first`` everybody decides for the tick that begins the run, and that is all:
    one entry from Python, because each has the whole compiled into it.

    room   a packed ``Room``
    watch  a packed ``Watch``
    """
    clock, engine, robot = room.clock, room.engine, room.robot
    physics, actors = room.physics, room.actors
    marks, scanner, path, travel = watch.marks, watch.scanner, watch.path, watch.travel
    if last < first:
        control(0.0, robot, physics, actors)
        return last
    people, drive, step = actors.people, robot.drive[0], 1.0 / SUBSTEPS_PER_S
    for row in range(first, last):
        if not (resumed and row == first):
            if clock[0] % SUBSTEPS_PER_TICK == 0:
                ramp(drive, robot.limits)
                physics.ctrl[robot.tyres[0]] = drive.left
                physics.ctrl[robot.tyres[1]] = drive.right
                physics.ctrl[robot.tyres[2]] = drive.side
            call(engine.step2, engine.model, engine.data)
            clock[0] += 1
            roll(drive, step)
            if people.alive:
                hold(people.held, physics.qpos, physics.qvel, physics.qfrc)
            pin(physics, actors.pinned)
            if people.alive:
                walk(
                    step, (physics.qpos, physics.qvel), people.torsos, people.limbs, people.feet,
                    people.crowd.state, physics.mocap,
                )  # fmt: skip
            if clock[0] % SUBSTEPS_PER_TICK == 0:
                control(clock[0] / SUBSTEPS_PER_S, robot, physics, actors)
                pin(physics, actors.pinned)
        dof = robot.at[1]
        if robot.push[dof] != 0.0 or robot.push[dof + 1] != 0.0 or robot.push[dof + 2] != 0.0:
            if len(robot.touches.geoms) == 0 and not resumed:
                return row
            collect(engine, robot.touches)
        call(engine.step1, engine.model, engine.data)
        for k in range(3):
            path[row + 1, k] = physics.qpos[robot.at[0] + k]
        travel[row + 1, 0] = drive.rolled_left
        travel[row + 1, 1] = drive.rolled_right
        travel[row + 1, 2] = drive.rolled_side
        if marks[row + 1]:
            note(scanner)
    return last


def loose() -> Pinned:
    """Nothing is pinned."""
    none = np.zeros(0, dtype=np.int64)
    return Pinned(none, np.zeros(0), none, none)


def unseen(rows: int) -> Watch:
    """A watch over ``rows`` rows that notes the robot alone."""
    none, flat = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    runs, poses = np.zeros((0, 4), dtype=np.int64), np.zeros((0, 0, 12))
    where = (flat, flat, flat, flat, flat, flat, flat)
    scanner = Noted(none, runs, *where, -1, poses, flat, none)
    marks = np.zeros(rows, dtype=np.bool_)
    return Watch(marks, scanner, np.zeros((rows, 3)), np.zeros((rows, 3)))
