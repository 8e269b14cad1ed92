# SPDX-License-Identifier: Apache-2.0
"""The moving rooms as a Gymnasium environment."""

from collections.abc import Sequence
from concurrent.futures import Executor
from copy import deepcopy
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from scenes import SCAN_HEIGHT
from sim.core.contacts import Contact
from sim.core.dynamism import Dynamism
from sim.gym.begin import Ahead, begun
from sim.gym.goals import GOAL_RADIUS_M, REWARDS, Goal, Task, goal_of
from sim.gym.observation import MODES, Observation, Rendering, observed, space_of
from sim.gym.options import checked_seed, checked_settings, clipped, episode
from sim.gym.pose_source import PoseSource
from sim.sensors.lidar.device import ScanResult
from sim.sensors.lidar.registry import ScannerConfig
from sim.simulation import Simulation
from slam.errors import MobiliaError
from slam.frames import LaserSpec
from slam.shaped import Positive, one_of, shaped, whole
from slam.system import SlamSystem

V_MAX_MPS, OMEGA_MAX_RADPS = 0.8, 1.2  # what an action of 1 means
MOST_SCANS = 1000  # of one step


class ResetNeededError(MobiliaError, gymnasium.error.ResetNeeded):
    """The environment must be reset first."""


class Outcome(NamedTuple):
    """Of a step, without its info."""

    observation: Observation
    reward: float
    terminated: bool
    truncated: bool


class MobiliaEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A robot with a laser scanner in a room that does not sit still; a step is one whole scan.

    With ``frame_skip`` it is so many scans under one command.

    ### Action space
    ``Box(-1, 1, (2,), float32)``: forward speed (times 0.8 m/s) and turn rate (times 1.2 rad/s,
    counter-clockwise), ramped by the robot. Finite numbers beyond [-1, 1] are clipped; NaN,
    infinities and anything that is not two numbers are refused with ``InvalidValueError``, and the
    room stays as it was.

    ### Observation space
    ``Dict`` of what the robot itself knows:

    | key        | shape | type    | meaning                                                     |
    |------------|-------|---------|-------------------------------------------------------------|
    | `ranges`   | (n,)  | float32 | m, right to left; no return and error codes are `range_max` |
    | `valid`    | (n,)  | uint8   | 1 where the range is a measurement                          |
    | `encoders` | (2,)  | int64   | ticks of the left and the right wheel since the reset       |
    | `time`     | ()    | float64 | s since the reset                                           |

    With ``pose_source`` also what it believes:

    | key        | shape | type    | meaning                                                     |
    |------------|-------|---------|-------------------------------------------------------------|
    | `pose`     | (3,)  | float64 | x m, y m, heading rad, in the frame of the start            |
    | `trusted`  | ()    | uint8   | 0 while the SLAM does not trust its own estimate            |
    | `goal`     | (2,)  | float64 | m, the goal as seen from `pose` (x ahead, y left); 0 if none |

    With the argument ``goal`` all of these, by odometry where there is no ``pose_source``, and

    | key          | shape | type    | meaning                                                   |
    |--------------|-------|---------|-----------------------------------------------------------|
    | `goal_polar` | (2,)  | float64 | range m and bearing rad (left > 0) of the goal from `pose` |

    ### Info
    Truth, only here (but for ``pose_source="truth"``): `pose` (3,) m, m, rad of the robot in the
    world; `frame`, the ``slam`` frame of the scan (with truth; give a SLAM
    ``frame.without_truth()``); `contacts`, names of what the robot touched during the step, and
    `hard_collision`, whether hard; `beam_time` (n,) s of each beam since the reset; `movers` name
    -> (x, y, heading) of everything that can move; `goal` (x, y) m in the world and `goal_distance`
    m, or None; `is_success`, whether the goal is reached.

    ### Reward
    0 without a goal, else by ``reward`` (``sim.gym.goals``):
    "progress": m by which the straight line to the goal got shorter during the step;
    "sparse": 1 in the step that reaches the goal, else 0;
    "shaped": m by which the way to it on the static layout got shorter (near walls counted up to
    three times), 10 for reaching it, -5 for a step with a hard collision, -0.1 for each second.

    ### Episode end
    ``terminated`` within 0.4 m of the goal, or (``terminate_on_collision``) on a hard collision;
    ``truncated`` after ``time_limit_s``. A step of several scans ends with its episode. A step
    after the end goes on in the same room; one before the first reset raises ``ResetNeededError``.

    ### Arguments
    ``scene``, ``dynamism``, ``motion``, ``change``, ``crowd``, ``laser``, ``scan_height_m``,
    ``odometry``, ``labels`` as in ``sim.Simulation``;
    ``pose_source``: None, "odometry", "shunting", any other SLAM's name, "module:Class", a
    ``SlamSystem``, or "truth"; it takes every scan and is reset with the environment, a failure of
    it is a ``SlamFailedError``. Reward and the end of an episode go by the truth in any case;
    ``goal``: None; "random", in each episode another one on floor that the robot can reach
    (``sim.gym.goals``), from the stream "goals" of the seed; or (x, y) m in the world;
    ``reward`` "progress", "sparse" or "shaped"; ``frame_skip`` scans to a step under one command;
    ``scans`` "all", or "last" for a step that takes only its last scan, which is twice as fast with
    four: a SLAM as ``pose_source`` gets no other, and of what may change only what it saw does;
    ``render_mode`` "rgb_array" (3D, needs OpenGL), "map" (2D, needs nothing) or None; ``view``
    "top", "follow" or "persp" for the former; ``render_size`` (width, height) px.

    ### Reset options
    They hold for one episode. An unknown key or a value of the wrong kind is refused by name with
    ``InvalidValueError``, as is a seed that is no whole number >= 0; the episode before goes on.

    | key                       | meaning                                                       |
    |---------------------------|---------------------------------------------------------------|
    | `goal`                    | "random", or (x, y) m: reward and end of the episode; refused  |
    |                           | where the robot cannot get to, with the nearest place it can  |
    | `start`                   | (x, y, heading) of the robot; refused where it does not fit   |
    | `n_chairs`, `n_people`    | counts, for scenes that have them                             |
    | `scene`                   | any options of the scene recipe, e.g. ``{"n_chairs": 8}``     |
    | `dynamism`                | 0 to 1, or a ``sim.core.dynamism.Dynamism``; replaces motion  |
    |                           | and change of the constructor too                             |
    | `motion`, `change`        | 0 to 1, one of the two axes alone                             |
    | `crowd`                   | who is there besides: "none", "escorts:6,boards:2"            |
    | `rates`                   | single rates of ``Dynamism``, e.g. ``{"door_rate": 0.1}``     |
    | `scan_height_m`           | of the scanner above the floor                                |
    | `laser`                   | a scanner by name, a ``Scanner`` or a ``Lms221Config``; where |
    |                           | a wrapper holds on to the observation space, give one of as   |
    |                           | many beams                                                    |
    | `seeds`                   | stream name -> seed (``sim.core.seeds``) |

    ### Version history
    The number is that of the world (``sim.core.versions``).
    v2: two axes, motion and change, and crowds; dynamism d of v1 is ``Dynamism.world_1(d)`` with
    ``crowd="none"``.
    v1: the table of ``sim.core.dynamism`` was set again; the same seed gives another world than in
    v0. v0: first version.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  (Gymnasium's own class attribute)
        "render_modes": list(MODES),
        "render_fps": 37,
    }

    def __init__(  # noqa: PLR0913 (settings by keyword)
        self,
        scene: str = "office",
        *,
        dynamism: float | Dynamism = 0.5,
        motion: float | None = None,
        change: float | None = None,
        crowd: str | None = None,
        laser: ScannerConfig | str | None = None,
        scan_height_m: float = SCAN_HEIGHT,
        odometry: str = "pioneer3dx",
        time_limit_s: float = 60.0,
        terminate_on_collision: bool = False,
        labels: bool = False,
        pose_source: str | SlamSystem | None = None,
        goal: str | Sequence[float] | None = None,
        reward: str = "progress",
        frame_skip: int = 1,
        scans: str = "all",
        render_mode: str | None = None,
        view: str = "top",
        render_size: tuple[int, int] = (640, 480),
    ) -> None:
        self._settings = checked_settings(
            scene=scene, dynamism=dynamism, motion=motion, change=change, crowd=crowd, laser=laser,
            scan_height_m=scan_height_m, odometry=odometry, labels=labels,
        )  # fmt: skip
        shaped("time_limit_s", time_limit_s, Positive)
        shaped("terminate_on_collision", terminate_on_collision, bool)
        one_of("reward", reward, REWARDS)
        whole("frame_skip", frame_skip, 1, MOST_SCANS)
        one_of("scans", scans, ("all", "last"))
        self._rendering = Rendering(render_mode, view, render_size)
        self.render_mode = render_mode
        self.time_limit_s = time_limit_s
        self.terminate_on_collision = terminate_on_collision
        self._goal, self._reward, self._scans = goal_of("goal", goal), reward, int(frame_skip)
        self._every_scan = scans == "all"
        if self._goal is not None and pose_source is None:
            pose_source = "odometry"
        self._pose_source = None if pose_source is None else PoseSource(pose_source)
        self._simulation: Simulation | None = None
        self._ahead: Ahead | None = None
        self._task: Task | None = None
        self.contacts: list[Contact] = []  # what the robot touched during the last step
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self._set_space(self._settings["laser"].spec())

    def _set_space(self, spec: LaserSpec) -> None:
        self._n_beams = spec.n_beams
        believing, polar = self._pose_source is not None, self._goal is not None
        self.observation_space = space_of(spec, believing=believing, polar=polar)

    @property
    def simulation(self) -> Simulation:
        """The running simulation; raises ``ResetNeededError`` before the first reset."""
        if self._simulation is None:
            raise ResetNeededError("call reset() before using the environment")
        return self._simulation

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Build the scene again and take a first scan standing still."""
        plan = episode(self._settings, options, self._goal)
        super().reset(seed=checked_seed(seed))
        own = int(self.np_random.integers(2**31))
        ahead, self._ahead = self._ahead, None
        built = None if ahead is None else ahead.room(None if options else own)
        room = built or begun(plan, own, self._reward)
        self._rendering.close()
        simulation = self._simulation = room.simulation
        self._task, self.contacts = room.task, simulation.contacts
        if simulation.spec.n_beams != self._n_beams:
            self._set_space(simulation.spec)
        if self._pose_source is not None:
            self._pose_source.reset(room.start)
        self._hear()
        return self._observation(room.scan), self._info()

    def prepare(self, threads: Executor) -> None:
        """Build the room that the next reset without a seed and options wants, on another thread.

        Every byte is the same, whether this was called or not: the reset waits for what is being
        built, builds itself what was not begun or failed, and drops what it does not want.
        """
        plan = episode(self._settings, None, self._goal)
        seed = int(deepcopy(self.np_random).integers(2**31))
        self._ahead = Ahead(seed, threads.submit(begun, plan, seed, self._reward))

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """``frame_skip`` scans under the given command, fewer where the episode ends."""
        outcome = self.act(*clipped(action))
        return *outcome, self._info()

    def act(self, v: float, omega: float) -> Outcome:
        """``step`` of a command in [-1, 1], without the info."""
        world, task = self.simulation.world, self._task
        start_ns = world.time_ns
        world.set_command(v * V_MAX_MPS, omega * OMEGA_MAX_RADPS)
        touched: list[Contact] = []
        scan: ScanResult | None = None
        for k in range(self._scans):
            self.simulation.live()
            touched += self.simulation.contacts
            hard = any(contact.hard for contact in touched)
            terminated = task is not None and task.reached(*self._place())
            terminated |= self.terminate_on_collision and hard
            truncated = world.time_ns * 1e-9 >= self.time_limit_s
            over = terminated or truncated or k + 1 == self._scans
            if over or self._every_scan:
                scan = self._look()
            else:
                self.simulation.blink()
            if over:
                break
        assert scan is not None  # of the last, there is one
        self.contacts, reward = touched, 0.0
        if task is not None:
            seconds = (world.time_ns - start_ns) * 1e-9
            reward = task.reward(*self._place(), hard=hard, seconds=seconds)
        return Outcome(self._observation(scan), reward, terminated, truncated)

    def _look(self) -> ScanResult:
        """The scan of the time that has passed, of which the source of the pose hears too."""
        scan = self.simulation.look()
        self._hear()
        return scan

    def _hear(self) -> None:
        if self._pose_source is not None:
            frame = self.simulation.frame
            assert frame is not None  # a scan was just taken
            self._pose_source.take(frame)

    def _place(self) -> tuple[float, float]:
        x, y, _ = self.simulation.world.robot_pose().tolist()
        return x, y

    def told(self) -> dict[str, Any]:
        """What of the info is cheap: truth of the robot, its goal and what it ran into."""
        return {
            "pose": self.simulation.world.robot_pose(),
            "goal": self.goal,
            "goal_distance": self.goal_distance,
            "hard_collision": any(contact.hard for contact in self.contacts),
            "is_success": self.is_success,
        }

    @property
    def goal(self) -> Goal | None:
        """(x, y) m in the world, if this episode has a goal."""
        return None if self._task is None else self._task.goal

    @property
    def goal_distance(self) -> float | None:
        """True m to the goal in a straight line, if this episode has one."""
        return None if self._task is None else self._task.distance

    @property
    def is_success(self) -> bool:
        """Whether the robot is truly at its goal."""
        return self._task is not None and self._task.distance < GOAL_RADIUS_M

    def _observation(self, scan: ScanResult) -> Observation:
        polar = self._goal is not None
        return observed(self.simulation, scan, self._pose_source, self.goal, polar=polar)

    def _info(self) -> dict[str, Any]:
        world, frame = self.simulation.world, self.simulation.frame
        assert frame is not None  # a scan was just taken
        return {
            **self.told(),
            "frame": frame,
            "beam_time": frame.stamp + self.simulation.spec.beam_time_offsets,
            "contacts": tuple(contact.name for contact in self.contacts),
            "movers": dict(zip(world.mover_names, world.mover_poses(), strict=True)),
        }

    def render(self) -> NDArray[np.uint8] | None:
        """The picture of ``render_mode``, (height, width, 3) uint8 RGB; None without a mode."""
        return None if self.render_mode is None else self._rendering.picture(self.simulation)

    def close(self) -> None:
        """Free the renderer; the environment can be reset again."""
        self._rendering.close()
