# SPDX-License-Identifier: Apache-2.0
"""The room that moves: one MuJoCo model and its actors, in substeps of 1/300 s.

What a substep is, is in ``sim.world.substeps``. Whoever moves things by hand (``data.qpos``)
between two of them calls ``mj_forward`` then.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.scene import Scene
from sim.actors.chairs import LEVELS, Shoves, pushers, stand_on_castors, tables
from sim.actors.doors import Doors
from sim.actors.people.people import People
from sim.actors.rearranging import Rearrangement, Rearranging
from sim.actors.robot import Drive, DriveConfig
from sim.actors.rolling import Rolling
from sim.core import state
from sim.core.bodies import Bodies
from sim.core.contacts import Contact, RobotContacts
from sim.core.dynamism import Dynamism
from sim.core.engine import engine, forward, warned
from sim.core.packed import packed
from sim.core.seeds import Seeds
from sim.world import sessions, substeps
from sim.world.populated import crowd_for, crowded, populated, with_visitors
from sim.world.robots import robot_of, with_robot
from sim.world.substeps import SUBSTEPS_PER_S, SUBSTEPS_PER_TICK
from sim.world.times_of_day import time_of
from slam.errors import InvalidValueError, UnstableError
from slam.frames import Float, LaserSpec
from slam.shaped import instance, one_of, within

__all__ = ["SUBSTEPS_PER_S", "SUBSTEPS_PER_TICK", "World"]

MOVING_SPEED = 0.02  # m/s; a mover faster than this counts as moving


class World:
    """A scene brought to life.

    scene     a built ``Scene``, or the name of one; a name is built from the "layout" stream
    seed      whole number or ``Seeds``
    dynamism  number in [0, 1] (see ``sim.core.dynamism``), or the rates themselves
    motion    in [0, 1]: that axis alone at this level instead
    moving_share  in [0, 1]: keep that share of chairs and loads on the move, instead of shoves
    change    in [0, 1]: of the things out of sight, the share that is found elsewhere when the
              robot sees them again (``sim.actors.rearranging``)
    session   number of a session of the same building (``sim.world.sessions``): then ``change`` is
              the share of what stands elsewhere than in the session before
    drive     limits of the robot
    start     (x m, y m, heading rad) of the robot instead of the scene's; a crowd that is put into
              the scene is put around it, one that is in a built ``Scene`` stays where it is
    chairs    "planar", or "free": standing on castors, able to rock (``sim.actors.chairs``)
    robot     another than the scene's (``sim.world.robots``), by its name or from its tables
    visitors  people who are outside until ``admit`` lets them in
    options   passed on to ``scenes.build`` when the scene is given by name, e.g. ``n_chairs=10``;
              ``scan_height_m`` and ``crowd`` are some that every scene has; the crowd is the
              scene's mix at this motion (``scenes.crowd``) where none is given

    Raises ``InvalidValueError`` for a dynamism outside [0, 1], ``UnknownNameError`` for a scene.
    """

    def __init__(  # noqa: PLR0913 (settings by keyword)
        self,
        scene: Scene | str,
        *,
        seed: int | Seeds = 0,
        dynamism: float | Dynamism = 0.5,
        moving_share: float | None = None,
        motion: float | None = None,
        change: float | None = None,
        session: int | None = None,
        drive: DriveConfig | None = None,
        start: Sequence[float] | None = None,
        chairs: str = "planar",
        visitors: int = 0,
        robot: str | Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        self.seeds = seed if isinstance(seed, Seeds) else Seeds(seed)
        self.rates = Dynamism.of(dynamism, moving_share, motion=motion, change=change)
        change = self.rates.change
        if session is None:
            built = populated(scene, self.seeds, self.rates, start, options)
        else:
            self.rates = sessions.slowed(self.rates, time_of(session).motion)
            given = options.pop("crowd", None)
            opened, self.seeds = sessions.opened(scene, self.seeds, change, session, options)
            crowd = crowd_for(scene, given, self.rates)
            built = crowded(opened, crowd, start, session, as_many_as_fit=given is None)
            change = 0.0
        built = with_visitors(built, visitors)
        self.robot = None if robot is None else robot_of(robot)
        if self.robot is not None:
            built, drive = with_robot(built, self.robot), drive or self.robot.drive
        self.scene = (
            stand_on_castors(built) if one_of("chairs", chairs, LEVELS) == "free" else built
        )
        self.model: mujoco.MjModel = self.scene.compile()
        self.data = mujoco.MjData(self.model)
        self.mover_names = tuple(m.name for m in self.scene.movers)
        self._clock = np.zeros(1, dtype=np.int64)
        self.bodies = Bodies(self.model, self.scene)
        self._contacts = RobotContacts(self.model, self.bodies)
        self.drive_config = DriveConfig() if drive is None else drive
        instance("drive", self.drive_config, DriveConfig)
        self._drive = Drive(self.model, self.drive_config, SUBSTEPS_PER_TICK / SUBSTEPS_PER_S)
        self._shoves = pushers(self.model, self.scene, self.rates, self.seeds)
        self._doors, self.people = self._doors_and_people()
        self._people_rows = self.bodies.rows(self.people.names)
        self._rearranging = self._rearranger(change)
        self.scene.place(self.model, self.data)
        if start is not None:
            self.bodies.place_robot(self.data, start)
        self.people.start(self.data, waiting=visitors)
        forward(self.model, self.data, f"scene '{self.scene.name}'")
        self._pinned = substeps.loose()
        self._room = self._tables()
        self._unseen = packed(substeps.unseen(2))
        substeps.advance(0, -1, False, self._room, self._unseen)  # decide, and no more
        mujoco.mj_step1(self.model, self.data)

    def _doors_and_people(self) -> tuple[Doors, People]:
        doors = Doors(
            self.model,
            self.bodies,
            self._named("door"),
            rate=self.rates.door_rate,
            counters=self._counters("doors"),
        )
        people = People(
            self.model,
            self.bodies,
            doors,
            stay_mean=self.rates.stay_mean,
            pace=self.rates.pace,
            counters=self._counters("people"),
        )
        return doors, people

    def _named(self, kind: str) -> list[str]:
        """Movers whose kind starts so: "chair" means both sorts."""
        return [m.name for m in self.scene.movers if m.kind.startswith(kind)]

    def _tables(self) -> Any:
        """Clock, engine, robot, physics and actors, as the kernels of ``substeps`` take them.

        All are views of the live arrays.
        """
        data, drive = self.data, self._drive
        at, dof = (int(a[0]) for a in self.bodies.addresses(["robot"]))
        robot = substeps.Robot(
            (at, dof), data.qfrc_constraint, self._contacts.table,
            drive.state, drive.tyres, drive.limits,
        )  # fmt: skip
        mocap = (data.mocap_pos, data.mocap_quat)
        physics = substeps.Physics(data.qpos, data.qvel, data.ctrl, data.qfrc_applied, mocap)
        shoved, rolled = tables(self.model, self._shoves)
        actors = substeps.Actors(
            self.people.for_kernels(), self._doors.leaves, shoved, rolled, self._pinned
        )
        room = substeps.Room(self._clock, engine(self.model, data), robot, physics, actors)
        return packed(room)

    def _rearranger(self, change: float) -> Rearranging | None:
        within("change", change, 0.0, 1.0)
        if change == 0.0 or self.bodies.robot is None:
            return None
        counters = self._counters("change")
        return Rearranging(self.model, self.scene, self.bodies, share=change, counters=counters)

    @property
    def change(self) -> float:
        """The share of what is out of sight that is put elsewhere."""
        return 0.0 if self._rearranging is None else self._rearranging.share

    def rearrange(self, *specs: LaserSpec, at_once: bool = False) -> list[Rearrangement]:
        """Between two scans: change what none of these scanners can see now.

        Every ``sim.actors.rearranging.PERIOD_S``; ``at_once``: whenever it is called.
        """
        if self._rearranging is None:
            return []
        if not self._rearranging.due(self.time_ns * 1e-9) and not at_once:
            return []
        poses, busy = self.mover_poses(), np.zeros(len(self.mover_names), dtype=np.bool_)
        busy[self.people.in_use(self.bodies)] = True
        busy |= self.bodies.any_at(self._pinned.at)
        done = self._rearranging.rearrange(self.time_ns * 1e-9, specs, poses, busy)
        rows = sorted({self.mover_names.index(event.name) for event in done})
        if rows:
            self.bodies.put(self.data, rows, poses[rows])
        return done

    def saw(self, hit: NDArray[np.int32]) -> None:
        """Take in which bodies a scan has hit: ``rearrange`` changes only what was seen."""
        if self._rearranging is not None:
            self._rearranging.saw(hit)

    def pin(self, pinned: substeps.Pinned) -> None:
        """Hold things at a place from now on, and bring all poses up to date."""
        self._pinned = pinned
        self.data.qpos[pinned.at] = pinned.places
        self.data.qvel[pinned.dofs] = 0.0
        self.bodies.restore_physics(self.data, self.bodies.physics_state(self.data))
        self._room = self._tables()

    def _counters(self, stream: str) -> NDArray[np.uint64]:
        return self.seeds.counters(stream, len(self.scene.movers))

    # -- time -------------------------------------------------------------------------------

    @property
    def time_ns(self) -> int:
        """Time since the start, ns: step k is k * 1e9 / 300, rounded to the nearest."""
        return (self.step_count * 10_000_000 + 1) // 3

    @property
    def step_count(self) -> int:
        """Substeps made since the start."""
        return int(self._clock[0])

    def substep(self) -> None:
        """Advance by 1/300 s and leave poses (``xpos``, ``geom_xpos``, ...) of the new instant."""
        self.advance(0, 1, self._unseen)

    def advance(self, first: int, last: int, watch: Any) -> None:
        """Make the substeps that end at rows ``first + 1`` to ``last`` of a packed ``Watch``.

        Raises ``UnstableError`` where MuJoCo warns: what it goes on with is no physics.
        """
        row = substeps.advance(first, last, False, self._room, watch)
        if row < last:  # the first touch
            self._contacts.locate(self.data)
            self._room = self._tables()
            substeps.advance(row, last, True, self._room, watch)
        if self.data.warning.number.any():
            at_s = 1e-9 * self.time_ns
            said = warned(self.model, self.data)
            raise UnstableError(f"scene '{self.scene.name}' at {at_s:.2f} s: {said}")

    # -- the robot --------------------------------------------------------------------------

    def set_command(self, v: float, omega: float, side: float = 0.0) -> None:
        """Ask the robot for a twist, m/s and rad/s; it is clipped and ramped (``DriveConfig``)."""
        self._drive.command(v, omega, side)

    def carry(self, pose: Sequence[float] | Float) -> None:
        """Put the robot at (x m, y m, heading rad), at rest; its wheels roll nothing on the way."""
        if self.bodies.robot is None:
            raise InvalidValueError(f"scene '{self.scene.name}' has no robot")
        self.bodies.put(self.data, [self.bodies.robot], np.array([pose], dtype=np.float64))
        self._drive.halt()

    def admit(self, names: Sequence[str], poses: Float) -> None:
        """Let people who are outside stand at (k, 3) poses and go where they like from now on."""
        rows = self.bodies.rows(names)
        self.bodies.put(self.data, rows.tolist(), poses)
        for name in names:
            self.people.enter(self.data, name, self.step_count / SUBSTEPS_PER_S)
        self.bodies.put(self.data, rows.tolist(), poses)  # with their limbs under them

    def robot_pose(self) -> Float:
        """(3,) ``T_world_robot``: x m, y m, heading rad (not wrapped)."""
        return self.bodies.robot_pose(self.data)

    def read_robot(self, pose: Float, travel: Float) -> None:
        """``robot_pose`` and ``wheel_angles`` and the way to the left into (3,) arrays."""
        self.bodies.read_robot(self.data, self._drive.state, pose, travel)

    def wheel_angles(self) -> Float:
        """(2,) m truly rolled by the left and the right wheel since the start."""
        return self._drive.travel_m[:2]

    def take_contacts(self) -> list[Contact]:
        """What the robot has touched since the last call, hardest first (``Contact.hard``)."""
        return self._contacts.take()

    # -- everything that moves --------------------------------------------------------------

    @property
    def doors(self) -> Doors:
        """The doors, as ``sim.world.hands`` opens them."""
        return self._doors

    @property
    def shoves(self) -> Mapping[str, Shoves | Rolling]:
        """What pushes chairs, bins and loads, by group."""
        return self._shoves

    def mover_poses(self) -> Float:
        """(n, 3) x m, y m, heading rad of each of ``scene.movers``, in that order.

        A door stands at its hinge and heads along its leaf.
        """
        return self.bodies.poses(self.data)

    def mover_speeds(self) -> Float:
        """(n,) m/s of each mover: its centre's speed or its rim's by turning, the greater."""
        return self.bodies.speeds(self.data)

    def movers_moving(self) -> NDArray[np.bool_]:
        """(n,) True for each of ``scene.movers`` faster than ``MOVING_SPEED``.

        A person with a foot in the air moves, however still the torso.
        """
        moving = self.mover_speeds() > MOVING_SPEED
        moving[self._people_rows] |= self.people.swinging()
        return moving

    # -- state ------------------------------------------------------------------------------

    def _actor_arrays(self) -> dict[str, NDArray[Any]]:
        arrays: dict[str, NDArray[Any]] = {"drive": state.flat(self._drive.state).ravel()}
        parts = {kind: shoves.arrays() for kind, shoves in self._shoves.items()}
        parts |= {"doors": self._doors.arrays(), "people": self.people.arrays()}
        if self._rearranging is not None:
            parts["change"] = self._rearranging.arrays()
        for owner, own in parts.items():
            arrays |= {f"{owner}.{name}": a for name, a in own.items()}
        return arrays

    def _fingerprint(self) -> dict[str, Any]:
        m = self.model
        size = [m.nq, m.nv, m.nu, m.nbody, m.ngeom]
        return {"scene": self.scene.name, "scan_height_m": self.scene.scan_height_m, "size": size}

    def save_state(self) -> bytes:
        """Everything that decides the future of this world, bit for bit.

        Load it into a world built with the same arguments, in this or another process.
        """
        physics = self.bodies.physics_state(self.data)
        words = {"steps": self.step_count, **self._fingerprint()}
        return state.pack({**physics, **self._actor_arrays()}, words)

    def load_state(self, block: bytes) -> None:
        """Go on from ``save_state``; ``InvalidValueError`` if it is of another kind of world."""
        arrays, words = state.unpack(block)
        steps = words.pop("steps", None)
        if words != self._fingerprint():
            raise InvalidValueError(f"the state is of {words}, this world is {self._fingerprint()}")
        live = self._actor_arrays()
        for name, array in live.items():
            if name not in arrays or arrays[name].shape != array.shape:
                raise InvalidValueError(f"the state has no '{name}' of shape {array.shape}")
        for name, array in live.items():
            array[...] = arrays[name]
        self._clock[0] = steps
        self.people.dress()
        self.bodies.restore_physics(self.data, arrays)
        self._contacts.take()
