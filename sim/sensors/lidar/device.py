# SPDX-License-Identifier: Apache-2.0
"""A scanner on a robot: any model, scan after scan, each beam cast at its own time.

Every beam is cast from the pose of the laser at its own time, on things where they are then: both
are linear between physics steps. A scan may begin and end between two steps
(``sim.sensors.lidar.schedule``).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from scenes.footprint import at_rest
from sim.sensors.lidar.caster import Noted, Raycaster
from sim.sensors.lidar.receiver import ScanResult, SignalModel
from sim.sensors.lidar.registry import ScannerConfig, scanner_of
from sim.sensors.lidar.schedule import Window, most_notes, schedule
from sim.sensors.lidar.surfaces import geom_reflectivity, glass_geoms, polished_geoms
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, LaserSpec

STEPS_PER_S = 300  # physics steps between which poses are noted

__all__ = ["LaserScanner", "ScanResult"]


def _planar(position: Float, matrix: Float) -> tuple[float, float, float]:
    """(x m, y m, yaw rad) of a frame in the world; ``matrix`` (9,) by rows."""
    rows = matrix.tolist()
    x, y, _ = position.tolist()
    return x, y, math.atan2(rows[3], rows[0])


class LaserScanner:
    """The scanner on the site ``robot/laser`` of a model.

    config  a ``Scanner``, a config that gives one, or a registered name; default the LMS-221
    rng     seeds one stream of draws for each effect; every scan takes the same number from each,
            whatever is hit, so that a run's noise depends neither on what moves in the world nor
            on which other effects are on

    Attributes: ``config``; ``scanner``, the model that it gives; ``spec``; ``phase``, the part of a
    physics step by which the next scan begins before the present one, 0 where scans last whole
    steps; ``carried``, whether the laser was moved by hand since the scan before: then the part of
    a scan that lies before the present is as if it had stood here; ``others``, the specs of the
    scanners ``beside`` it, and ``seen_by_others``, their scans.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        config: ScannerConfig | str | None = None,
        rng: np.random.Generator | None = None,
        *,
        site: str = "robot/laser",
        robot: str = "robot/base",
    ) -> None:
        self.config = scanner_of(config)
        self.scanner = scanner = self.config.scanner()
        _check_timestep(model)
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site)
        if number < 0:
            raise InvalidValueError(f"LaserScanner.site: the model has no site {site!r}")
        data = at_rest(model)
        self.spec = scanner.spec(_mounting(model, data, number, robot))
        self.caster = Raycaster(
            model,
            height=float(data.site_xpos[number][2]),
            robot=robot,
            spot=scanner.spot,
            range_max=scanner.range_max_m,
            slots=most_notes(scanner, STEPS_PER_S),
            panes=glass_geoms(model) if scanner.glass else None,
            site=number,
        )
        ids = self.caster.ids
        polished = polished_geoms(model)[ids] & scanner.bounce
        bodies = model.geom_bodyid[ids].astype(np.int64)
        self._surface = (geom_reflectivity(model)[ids], polished, ids, bodies)
        self._signal = SignalModel(
            scanner, self._surface, np.random.default_rng(0) if rng is None else rng
        )
        self.others: tuple[LaserSpec, ...] = ()
        self.seen_by_others: list[ScanResult] = []
        self._signals_of_others: list[SignalModel] = []
        self._polished = polished
        bounces = scanner.bounce and (self.caster.layers > 1 or bool(polished.any()))
        room = self.spec.n_beams if bounces else 0
        self._mirrored = (np.empty(room), np.empty(room, dtype=np.int64), np.empty(room))
        self._windows = schedule(scanner, self.spec, STEPS_PER_S)
        self.phase = Fraction(0)
        self.window: Window = self._windows(self.phase)
        # Of the scan before, where the next begins within its last step: the notes of that step.
        self._before: Noted | None = None
        self._after: Noted | None = None
        self.carried = False

    @property
    def streams(self) -> tuple[np.random.Generator, ...]:
        """The random streams, for who saves and restores the state of a run."""
        signals = (self._signal, *self._signals_of_others)
        return tuple(stream for signal in signals for stream in signal.streams)

    def beside(self, places: Sequence[Float], seeds: np.random.SeedSequence) -> None:
        """More scanners of this model, elsewhere on the robot at this height.

        All turn together: what stood where when, they take from the notes of this one, so they
        change neither its scans nor the world. Raises ``InvalidValueError`` for a place that is
        taken: scans are told apart by it.
        """
        for T_robot_laser, own in zip(places, seeds.spawn(len(places)), strict=True):
            spec, rng = self.scanner.spec(T_robot_laser), np.random.default_rng(own)
            if spec.mount in [one.mount for one in (self.spec, *self.others)]:
                x, y, yaw = spec.mount
                raise InvalidValueError(
                    f"two scanners of a robot are at ({x:g} m, {y:g} m, {math.degrees(yaw):g} deg)"
                    ": place each of them elsewhere"
                )
            self.others += (spec,)
            self._signals_of_others.append(SignalModel(self.scanner, self._surface, rng))

    def observe(self, advance: Callable[[], None], data: mujoco.MjData) -> ScanResult:
        """Run one scan: calls of ``advance``, each one physics step of 1/300 s.

        ``data`` must have fresh kinematics on entry, and after every ``advance``.
        """
        self.begin(data)
        window = self.window
        for due in window.marks[window.before + 1 :].tolist():
            advance()
            if due:
                self.caster.note()
        return self.finish()

    def begin(self, data: mujoco.MjData) -> Any:
        """Start a scan, whose ``window`` is then known.

        Who advances the world calls ``windows.note`` with what is returned at ``window.marks``.
        """
        self.caster.start(data, self._before)
        self.carried = self._after is not None and not self.caster.settle(self._after)
        if not self.window.repeats:
            self.window = self._windows(self.phase)
        return self.caster.noted

    def finish(self) -> ScanResult:
        """The scan that was begun, once the steps of its ``window`` have passed."""
        window = self.window
        self.seen_by_others = self._beside()
        self.caster.cast(window.plan)
        if not window.repeats:
            self.phase = window.next
            self._before, self._after = self.caster.last_notes() if self.phase else (None, None)
        return self._received(self._signal)

    def _received(self, signal: SignalModel) -> ScanResult:
        if self._mirrored[0].size:
            self.caster.mirror(self._polished, self._mirrored)
        return signal.scan(self.caster.hits, self._mirrored)

    def _beside(self) -> list[ScanResult]:
        """The scans of the others, from this one's notes."""
        own, scans = self.caster.lasers.copy(), []
        for spec, signal in zip(self.others, self._signals_of_others, strict=True):
            T_laser_other = se2.between(self.spec.T_robot_laser, spec.T_robot_laser)
            for slot, T_world_laser in enumerate(own):
                self.caster.lasers[slot] = se2.compose(T_world_laser, T_laser_other)
            self.caster.cast(self.window.plan)
            scans.append(self._received(signal))
        self.caster.lasers[:] = own
        return scans

    def blink(self) -> bool:
        """Leave out the scan that was begun, with its draws; False where the next one needs it."""
        if self.window.repeats:
            for signal in (self._signal, *self._signals_of_others):
                signal.blink(self.spec.n_beams)
        return self.window.repeats

    def skip(self) -> None:
        """Go on to the window of the next scan without one: for who only wants the times."""
        self.phase = self.window.next
        self.window = self._windows(self.phase)

    # -- state between two scans --------------------------------------------------------------

    def save(self) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """What decides the next scan beside the random streams: arrays, and JSON words.

        Nothing where scans last whole steps.
        """
        if self._before is None:
            return {}, {}
        poses, laser, _ = self._before
        arrays = {"geoms": self.caster.movable_ids, "geom_poses": poses, "laser": laser}
        return arrays, {"phase": [self.phase.numerator, self.phase.denominator]}

    def load(self, arrays: Mapping[str, NDArray[Any]], words: Mapping[str, Any]) -> None:
        """Go on from ``save``, also that of a scanner that saw more things.

        Raises ``InvalidValueError`` for a state that is not of this model.
        """
        self.phase, self._before, self._after = Fraction(0), None, None
        self.window = self._windows(self.phase)
        if not words:
            return
        known = {int(geom): row for row, geom in enumerate(arrays["geoms"])}
        wanted = self.caster.movable_ids.tolist()
        phase = Fraction(*words["phase"])
        if any(geom not in known for geom in wanted) or not 0 <= phase < 1:
            raise InvalidValueError("the state is of another scanner, or of another world")
        rows = [known[geom] for geom in wanted]
        self.phase, self.window = phase, self._windows(phase)
        self._before = (arrays["geom_poses"][rows], arrays["laser"].copy(), np.array(np.nan))


def _check_timestep(model: mujoco.MjModel) -> None:
    if not math.isclose(model.opt.timestep, 1.0 / STEPS_PER_S, rel_tol=1e-6):
        raise InvalidValueError(
            f"the model's timestep is {model.opt.timestep} s, expected 1/{STEPS_PER_S} s"
        )


def _mounting(model: mujoco.MjModel, data: mujoco.MjData, site: int, robot: str) -> Float:
    """``T_robot_laser`` from the model."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot)
    if body < 0:
        raise InvalidValueError(f"LaserScanner.robot: the model has no body {robot!r}")
    T_world_robot = _planar(data.xpos[body], data.xmat[body])
    return se2.between(T_world_robot, _planar(data.site_xpos[site], data.site_xmat[site]))
