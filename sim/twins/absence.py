# SPDX-License-Identifier: Apache-2.0
"""The same room without one of its movers, or with one that has stopped: for counterfactuals.

A mover that is **out** is parked beside the floor, held there, touches nothing and is met by no
ray; a door, which cannot leave its hinge, stands wide open instead, unseen and untouchable (people
still keep a hand's breadth off the open leaf). One that is **frozen** stays where it is, whatever
pushes it: nobody shoves it, it does not walk (a foot in the air comes down), no closer pulls it.

Who goes out takes along what it holds (a board, a train of trolleys); of a couch between two the
other one stays, with empty hands. Who followed somebody that is out stands where it is. A chair
that somebody has just taken up stays, and whoever held what is out goes on without.

The model keeps its size, so a state saved without either fits a simulation with it and the other
way round. Nobody else draws other numbers: every actor has a generator of its own. What the others
do may differ all the same, because they meet, or no longer meet, what was changed.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.groups import with_held
from scenes.kinds import is_door, joint_of_door
from sim.actors.config import DOORS
from sim.actors.people import columns
from sim.sensors.lidar.candidates import HULL_GROUP
from sim.sensors.lidar.device import LaserScanner
from sim.simulation import Simulation
from sim.world.substeps import Pinned
from sim.world.world import World
from slam.errors import InvalidValueError, UnknownNameError

Int = NDArray[np.int64]
BESIDE_M, APART_M = 20.0, 3.0  # from the floor to the first one parked, and between these


@dataclass(frozen=True, kw_only=True)
class Change:
    """What is different: names of movers that are out, and of those that are frozen.

    called  what they are called together, "" for their names
    """

    out: tuple[str, ...] = ()
    frozen: tuple[str, ...] = ()
    called: str = ""

    def __post_init__(self) -> None:
        names = [*self.out, *self.frozen]
        if len(set(names)) < len(names):
            raise InvalidValueError(f"Change: a mover is named twice in {', '.join(names)}")

    def __str__(self) -> str:
        named = (("out", self.out), ("frozen", self.frozen))
        words = [f"{self.called or ' + '.join(names)} {how}" for how, names in named if names]
        return ", ".join(words) or "as it was"


def apply(simulation: Simulation, change: Change, *, held: bool = True) -> None:
    """Take movers out of a simulation, or freeze them, from its present state on.

    Once for a simulation, after ``load_state``. ``held``: what they hold goes out, too; else it
    stands where it was let go. Raises ``UnknownNameError`` for a name that no
    mover has and ``InvalidValueError`` for the robot.
    """
    world = simulation.world
    for name in (*change.out, *change.frozen):
        _check(world, name)
    out = with_held(world.scene.holds, change.out) if held else change.out
    for name in out:
        _hide(world, name)
    if out:
        _look_again(simulation)
    for name in out:
        _park(world, name)
    if out:
        _let_go(world, out)
    frozen = [name for name in change.frozen if name not in out]
    for name in (*frozen, *_left_behind(world, out)):
        _halt(world, name, seated=True)
    world.people.dress()
    world.pin(_pinned(world, (*out, *frozen)))


def _check(world: World, name: str) -> None:
    if name not in world.mover_names:
        raise UnknownNameError(
            f"no mover is called '{name}'. Known: {', '.join(world.mover_names)}."
        )
    if world.scene.movers[world.mover_names.index(name)].group == "robot":
        raise InvalidValueError("the robot cannot be taken out: it is who looks")


def _bodies(world: World, name: str) -> Int:
    """Ids of the bodies of a mover, limbs included."""
    found = np.flatnonzero(world.bodies.mover_of_body == world.mover_names.index(name))
    return found.astype(np.int64)


def _hide(world: World, name: str) -> None:
    """No ray meets it, and nothing touches it."""
    model = world.model
    own = np.isin(model.geom_bodyid, _bodies(world, name))
    model.geom_group[own] = HULL_GROUP
    model.geom_contype[own] = 0
    model.geom_conaffinity[own] = 0
    if name in world.people.names:  # whose hulls follow who sits
        world.people.table.hulls.bits[world.people.names.index(name)] = 0


def _look_again(simulation: Simulation) -> None:
    """A scanner that does not see what is hidden now, with the draws of the one before."""
    before = simulation.laser
    seeds = simulation.world.seeds
    laser = LaserScanner(simulation.world.model, before.config, seeds.generator("lidar"))
    for new, old in zip(laser.streams, before.streams, strict=True):
        new.bit_generator.state = old.bit_generator.state
    laser.load(*before.save())
    simulation.use_laser(laser)


def _park(world: World, name: str) -> None:
    row, qpos = world.mover_names.index(name), world.data.qpos
    addresses = _qpos_of(world, name)
    kind = world.scene.movers[row].kind
    if is_door(kind):
        joint = world.model.joint(f"{name}/{joint_of_door(kind)}")
        qpos[addresses] = min(DOORS.opened_rad, float(joint.range[1]))
        return
    _, ymin, xmax, _ = world.scene.bounds
    qpos[addresses] = 0.0
    qpos[addresses[0]] = xmax + BESIDE_M + APART_M * row
    qpos[addresses[1]] = ymin
    _free_seat(world, name)
    _halt(world, name, seated=False)
    if name in world.people.names:
        world.people.stand(world.data, name)


def _let_go(world: World, out: Sequence[str]) -> None:
    """Open the hands of those who are out, and the hands on what is out; no force stays."""
    people, (_, dofs) = world.people, world.bodies.addresses(out)
    held, task, qfrc = people.table.held, people.crowd.task, world.data.qfrc_applied
    gone = np.isin(held.at["va"], dofs) | np.isin(held.at["vb"], dofs)
    for k in np.flatnonzero(gone & (held.at["qb"] >= 0)):
        for first in (held.at["va"][k], held.at["vb"][k]):
            qfrc[first : first + 3] = 0.0
        held.at["qb"][k] = held.at["vb"][k] = -1
    discs = people.table.at.discs[:, 1]
    rows = np.flatnonzero(np.isin(discs, dofs))
    empty = np.isin(task["held"], rows) | np.isin(discs[: len(task)], dofs)
    for i in np.flatnonzero(empty & (task["held"] >= 0)):
        task["held"][i] = -1
        if task["walking"][i] == columns.TO_CHAIR or task["hand"][i] >= 0:
            task["walking"][i] = columns.STANDS


def _left_behind(world: World, out: Sequence[str]) -> list[str]:
    """Those whose leader is out, and who is not out as well."""
    roles = world.scene.roles.items()
    return [name for name, role in roles if role.leader in out and name not in out]


def _free_seat(world: World, name: str) -> None:
    """Who sits on it, or is about to, stands there."""
    at, task = world.people.table.at, world.people.crowd.task
    rows = np.flatnonzero(at.discs[:, 0] == _qpos_of(world, name)[0])
    sitters = np.flatnonzero(np.isin(task["seat"], rows))
    task["seat"][sitters] = -1
    walking = task["walking"][sitters] == columns.WALKS
    task["walking"][sitters[~walking]] = columns.STANDS
    world.people.crowd.state["sit"][sitters] = 0.0


def _halt(world: World, name: str, *, seated: bool) -> None:
    """A person that goes nowhere any more; ``seated``: one that sits stays so."""
    if name not in world.people.names:
        return
    i, crowd = world.people.names.index(name), world.people.crowd
    state, task = crowd.state[i], crowd.task[i]
    if not (seated and task["walking"] == columns.SEATED):
        task["walking"] = columns.STANDS
        if not seated or state["sit"] == 0.0:
            task["seat"] = -1
            state["sit"] = 0.0
    state["stay_until"] = state["look_until"] = math.inf
    state["vx"] = state["vy"] = state["blocked"] = 0.0


def _joints(world: World, name: str) -> list[int]:
    owners = world.model.jnt_bodyid
    return np.flatnonzero(np.isin(owners, _bodies(world, name))).tolist()


def _qpos_of(world: World, name: str) -> Int:
    """Addresses in qpos of a mover's joints, all slides and hinges; x, y, yaw first."""
    return np.array([world.model.jnt_qposadr[j] for j in _joints(world, name)], dtype=np.int64)


def _pinned(world: World, names: Sequence[str]) -> Pinned:
    model = world.model
    at = [int(q) for name in names for q in _qpos_of(world, name)]
    joints = [j for name in names for j in _joints(world, name)]
    transmission = int(mujoco.mjtTrn.mjTRN_JOINT)
    servos = np.flatnonzero(
        (model.actuator_trntype == transmission) & np.isin(model.actuator_trnid[:, 0], joints)
    )
    return Pinned(
        np.array(at, dtype=np.int64),
        world.data.qpos[at].copy(),
        np.array([model.jnt_dofadr[j] for j in joints], dtype=np.int64),
        servos.astype(np.int64),
    )
