# SPDX-License-Identifier: Apache-2.0
"""The SICK LMS-221: mirror turns, interlacing, range codes and noise.

Numbers are from the manufacturer's technical description (TD, 8008970/06-2003) and telegram
listing (TL, 8007954/2006-08-01). The mirror turns 75 times a second, counter-clockwise seen from
above; the 180 degree field of view is its first half turn. Each turn measures in 1 degree steps;
0.5 and 0.25 degree scans are two and four turns, each started 0.5 or 0.25 degree later, and sorted
by angle on output (TL p19, p47). So neighbouring beams of such a scan are one mirror turn apart in
time: what a moving robot sees is combed, and so it is here.

A turn is four physics steps of 1/300 s (13.33 ms; the data sheet prints 13.32): the sweep takes
the first two. Every beam is cast from the pose of the laser at its own time, on things where they
are then: both are linear between physics steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.core.checks import instance
from sim.sensors.lidar.caster import FanPlan, Raycaster
from sim.sensors.lidar.config import (
    DEGREES_PER_STEP,
    STEPS_PER_SWEEP,
    STEPS_PER_TURN,
    TURNS_PER_S,
    Lms221Config,
)
from sim.sensors.lidar.receiver import ScanResult, SignalModel, spot_of
from sim.sensors.lidar.surfaces import geom_reflectivity, glass_geoms, polished_geoms
from slam import se2
from slam.errors import InvalidValueError

Float = NDArray[np.float64]

__all__ = ["Lms221", "Lms221Config", "ScanResult"]


def _planar(position: Float, matrix: Float) -> tuple[float, float, float]:
    """(x m, y m, yaw rad) of a frame in the world; ``matrix`` (9,) by rows."""
    rows = matrix.tolist()
    x, y, _ = position.tolist()
    return x, y, math.atan2(rows[3], rows[0])


class Lms221:
    """The scanner on the site ``robot/laser`` of a model.

    ``rng`` seeds one stream of draws for each effect; every scan takes the same number from each,
    whatever is hit, so that a run's noise depends neither on what moves in the world nor on which
    other effects are on.

    ``marks`` (steps + 1,): whether poses are noted when that many steps of a scan are over.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        config: Lms221Config | None = None,
        rng: np.random.Generator | None = None,
        *,
        site: str = "robot/laser",
        robot: str = "robot/base",
    ) -> None:
        self.config = Lms221Config() if config is None else config
        instance("laser", self.config, Lms221Config)
        _check_timestep(model)
        number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site)
        if number < 0:
            raise InvalidValueError(f"Lms221.site: the model has no site {site!r}")
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self.spec = self.config.spec(_mounting(model, data, number, robot))
        effects = self.config.effects
        self.caster = Raycaster(
            model,
            height=float(data.site_xpos[number][2]),
            robot=robot,
            spot=spot_of(effects),
            range_max=self.config.mode.range_max_m,
            panes=glass_geoms(model) if effects.glass else None,
            site=number,
        )
        ids = self.caster.ids
        polished = polished_geoms(model)[ids] & effects.bounce
        bodies = model.geom_bodyid[ids].astype(np.int64)
        surface = (geom_reflectivity(model)[ids], polished, ids, bodies)
        self._signal = SignalModel(
            self.config, surface, np.random.default_rng(0) if rng is None else rng
        )
        self._polished = polished
        bounces = effects.bounce and (self.caster.layers > 1 or bool(polished.any()))
        room = self.spec.n_beams if bounces else 0
        self._mirrored = (np.empty(room), np.empty(room, dtype=np.int64), np.empty(room))
        self._fans = self._plan()
        step = np.arange(self.config.steps + 1)
        self.marks = (step % STEPS_PER_TURN <= STEPS_PER_SWEEP) & (step < self.config.steps)

    def _plan(self) -> FanPlan:
        """One fan for each turn of the mirror: a sweep is two physics steps, with three ends."""
        degrees, turn = self.config.beams
        fans = []
        for k in range(self.config.turns):
            beams = np.flatnonzero(turn == k)
            steps = degrees[beams] / DEGREES_PER_STEP
            slots = np.minimum(np.floor(steps), STEPS_PER_SWEEP - 1)
            notes = (STEPS_PER_SWEEP + 1) * k + slots
            fans.append((beams, self.spec.angles[beams], notes, steps - slots))
        return FanPlan.of(fans)

    @property
    def streams(self) -> tuple[np.random.Generator, ...]:
        """The random streams, for who saves and restores the state of a run."""
        return self._signal.streams

    def observe(self, advance: Callable[[], None], data: mujoco.MjData) -> ScanResult:
        """Run one scan: ``config.steps`` calls of ``advance``, each one physics step of 1/300 s.

        ``data`` must have fresh kinematics on entry, and after every ``advance``.
        """
        self.begin(data)
        for due in self.marks[1:].tolist():
            advance()
            if due:
                self.caster.note()
        return self.finish()

    def begin(self, data: mujoco.MjData) -> tuple[Any, ...]:
        """Start a scan; who advances the world calls ``windows.note`` with this at ``marks``."""
        self.caster.start(data)
        return self.caster.noted

    def finish(self) -> ScanResult:
        """The scan that was begun, once ``config.steps`` have passed."""
        self.caster.cast(self._fans)
        if self._mirrored[0].size:
            self.caster.mirror(self._polished, self._mirrored)
        return self._signal.scan(self.caster.hits, self._mirrored)


def _check_timestep(model: mujoco.MjModel) -> None:
    wanted = 1.0 / (TURNS_PER_S * STEPS_PER_TURN)
    if not math.isclose(model.opt.timestep, wanted, rel_tol=1e-6):
        raise InvalidValueError(
            f"the model's timestep is {model.opt.timestep} s, expected 1/300 s: "
            "four steps are one turn of the mirror"
        )


def _mounting(model: mujoco.MjModel, data: mujoco.MjData, site: int, robot: str) -> Float:
    """``T_robot_laser`` from the model."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot)
    if body < 0:
        raise InvalidValueError(f"Lms221.robot: the model has no body {robot!r}")
    T_world_robot = _planar(data.xpos[body], data.xmat[body])
    return se2.between(T_world_robot, _planar(data.site_xpos[site], data.site_xmat[site]))
