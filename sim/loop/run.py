# SPDX-License-Identifier: Apache-2.0
"""One run in a closed loop: the room moves, the SLAM believes, the robot goes there.

``Referee`` knows what truly happened (collisions, near misses, goals taken by others) and steers
nothing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sim.core.contacts import Contact
from sim.loop.navigator import Decision, LoopConfig, Navigator
from sim.simulation import Simulation
from sim.world.world import World
from slam import se2
from slam.answers import judged
from slam.errors import SlamFailedError, UnknownNameError
from slam.evaluation import lost
from slam.frames import NS_PER_S, Float, Frame
from slam.frontend.odometry_steps import MotionSum
from slam.replay import Track
from slam.system import SlamSystem, refuse_at_the_end

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


OUTCOMES = ("reached", "wrong", "given up", "failed")


@dataclass(frozen=True, kw_only=True)
class GoalResult:
    """What became of one goal.

    outcome        "reached": believed and true; "wrong": believed, but truly further than the
                   tolerance; "given up"; "failed": the SLAM had failed
    reason         of giving up: "no way", "no progress" or "time"; how it failed
    precision_m    true distance to the goal when it believed it had arrived, else None
    precision_rad  then, the believed heading less the true one
    time_s         simulated, from the last goal's end to this one's
    driven_m       true way
    tally          collisions and near misses
    taken          what stands on the goal at the end, if anything does
    """

    goal: str
    outcome: str
    reason: str = ""
    precision_m: float | None = None
    precision_rad: float | None = None
    time_s: float = 0.0
    driven_m: float = 0.0
    tally: Tally
    taken: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopRun:
    """All goals of one run, and its path, a row for each update of the SLAM.

    believed, true  (n, 3) T_world_robot
    commands        (n, 2) m/s, rad/s from then on
    trusted         (n,) whether the SLAM trusted itself
    goal_of         (n,) index into ``goals``
    lost_s          when the estimate was lost first (``slam.evaluation.lost``), s; None: never
    found_s         when it was found again after that
    failure         how the SLAM failed (``SlamFailedError.outcome``) and in words, "" if it did not
    """

    goals: tuple[GoalResult, ...]
    stamps_ns: NDArray[np.int64]
    believed: Float
    true: Float
    commands: Float
    trusted: NDArray[np.bool_]
    goal_of: NDArray[np.int64]
    lost_s: float | None
    found_s: float | None
    failure: tuple[str, str]


def goal_order(world: World, wanted: int | Sequence[str] | None = None) -> list[str]:
    """Goals of the scene in the order of the seed's "driving" stream: all, so many, or these."""
    names = sorted(world.scene.goals)
    if wanted is not None and not isinstance(wanted, int):
        for name in wanted:
            if name not in world.scene.goals:
                raise UnknownNameError(
                    f"scene '{world.scene.name}' has no goal '{name}'. Known: {', '.join(names)}."
                )
        return list(wanted)
    order = world.seeds.generator("driving").permutation(len(names))
    return [names[k] for k in order][:wanted]


def closed_loop(
    simulation: Simulation,
    system: SlamSystem,
    *,
    config: LoopConfig | None = None,
    goals: int | Sequence[str] | None = None,
    name: str = "slam",
) -> LoopRun:
    """Drive to each goal in turn, steered by ``system`` alone; it is reset first.

    A SLAM that raises, or returns what is no estimate, ends the run: its goals are "failed". Raises
    ``UnknownNameError`` for a goal that the scene does not have, and ``InvalidValueError`` for a
    SLAM that runs at the end only.
    """
    refuse_at_the_end(system, name, "a closed loop")
    ride = _Ride(simulation, system, config or LoopConfig(), name)
    results = [ride.to(goal) for goal in goal_order(simulation.world, goals)]
    return ride.result(results)


class _Ride:
    """One run as it goes on."""

    def __init__(
        self, simulation: Simulation, system: SlamSystem, config: LoopConfig, name: str
    ) -> None:
        self._simulation, self._config = simulation, config
        self._world = simulation.world
        self._track = Track(name=name, system=system)
        self._navigator = Navigator(self._world.scene, np.array(self._world.robot_pose()), config)
        self._referee = Referee(self._world, config.near_m)
        self._failure: SlamFailedError | None = None
        self._rows: list[tuple[int, Float, Float, tuple[float, float], bool]] = []
        self._motion = MotionSum()
        self._firsts: list[int] = []  # rows at which goals begin
        try:
            with judged(system.reset):
                system.reset()
        except SlamFailedError as error:
            self._failure = error.at(f"SLAM '{name}', reset()")

    def to(self, goal: str) -> GoalResult:
        """Drive to one goal."""
        place = np.array(self._world.scene.goals[goal], dtype=np.float64)
        began_ns, first = self._world.time_ns, len(self._rows)
        self._firsts.append(first)
        self._navigator.aim(place)
        over = ""
        while not over and self._failure is None:
            try:
                over = self._step().over
            except SlamFailedError as error:
                self._failure = error
        self._simulation.world.set_command(0.0, 0.0)
        blank = GoalResult(
            goal=goal,
            outcome="failed",
            reason=over,
            time_s=(self._world.time_ns - began_ns) * 1e-9,
            driven_m=_way(np.array([row[2] for row in self._rows[first:]]).reshape(-1, 3)),
            tally=self._referee.close(),
            taken=self._referee.taken(place),
        )
        if self._failure is not None:
            return replace(blank, reason=self._failure.outcome)
        if over != "arrived":
            return replace(blank, outcome="given up")
        _, believed, true, _, _ = self._rows[-1]
        off = math.hypot(true[0] - place[0], true[1] - place[1])
        return replace(
            blank,
            outcome="reached" if off <= self._config.tolerance_m else "wrong",
            reason="",
            precision_m=off,
            precision_rad=se2.wrap(float(believed[2] - true[2])),
        )

    def _step(self) -> Decision:
        """One update of the SLAM and the command that follows."""
        frame, true = self._frame(self._config.scans if self._rows else 1)
        estimate = self._track.take(frame)
        lag_s = (self._world.time_ns - frame.stamp_ns) * 1e-9
        decision = self._navigator.decide(frame, estimate, self._track.map, lag_s)
        self._world.set_command(decision.v, decision.omega)
        believed, command = self._navigator.believed(estimate), (decision.v, decision.omega)
        self._rows.append((frame.stamp_ns, believed, true, command, estimate.converged))
        return decision

    def _frame(self, scans: int) -> tuple[Frame, Float]:
        """The last of so many scans, with the covariance of all the motion since the one before,
        without its truth; and its truth."""
        for _ in range(scans):
            frame = self._simulation.observe()
            self._referee.watch(self._simulation.contacts)
            self._motion.add(frame.odometry)
        assert frame.truth is not None  # the simulator always knows
        return self._motion.passed_on(frame).without_truth(), frame.truth

    def result(self, goals: Sequence[GoalResult]) -> LoopRun:
        """All of it."""
        stamps = np.array([row[0] for row in self._rows], dtype=np.int64)
        believed = np.array([row[1] for row in self._rows]).reshape(-1, 3)
        true = np.array([row[2] for row in self._rows]).reshape(-1, 3)
        seconds = (stamps - stamps[:1]) / NS_PER_S
        offset = believed - true
        distances = np.sqrt(offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1])
        errors = seconds, distances, se2.wrap_array(offset[:, 2])
        lost_s = lost.lost_at(*errors)
        failure = self._failure
        return LoopRun(
            goals=tuple(goals),
            stamps_ns=stamps,
            believed=believed,
            true=true,
            commands=np.array([row[3] for row in self._rows]).reshape(-1, 2),
            trusted=np.array([row[4] for row in self._rows], dtype=np.bool_),
            goal_of=np.searchsorted(self._firsts, np.arange(len(stamps)), side="right") - 1,
            lost_s=lost_s,
            found_s=None if lost_s is None else lost.found_again_at(*errors, lost_s),
            failure=("", "") if failure is None else (failure.outcome, str(failure)),
        )


def _way(path: Float) -> float:
    """m along the positions of (n, 3)."""
    steps = path[1:, :2] - path[:-1, :2]
    return float(np.sqrt((steps * steps).sum(axis=1)).sum())
