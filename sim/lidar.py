# SPDX-License-Identifier: Apache-2.0
"""The SICK LMS-221: mirror turns, interlacing, range codes and noise.

Numbers are from the manufacturer's technical description (TD, 8008970/06-2003) and telegram
listing (TL, 8007954/2006-08-01). The mirror turns 75 times a second, counter-clockwise seen from
above; the 180 degree field of view is its first half turn. Each turn measures in 1 degree steps;
0.5 and 0.25 degree scans are two and four turns, each started 0.5 or 0.25 degree later, and sorted
by angle on output (TL p19, p47). So neighbouring beams of such a scan are one mirror turn apart in
time: what a moving robot sees is combed, and so it is here.

A turn is four physics steps of 1/300 s (13.33 ms; the data sheet prints 13.32): the sweep takes
the first two. Every beam is cast from the pose of the laser at its own time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.caster import Raycaster
from sim.lidar_config import (
    DEGREES_PER_STEP,
    STEPS_PER_SWEEP,
    STEPS_PER_TURN,
    TURNS_PER_S,
    Lms221Config,
)
from sim.lidar_effects import (
    PANE_RETURN_COS,
    PANE_TRANSMISSION,
    SignalModel,
    geom_reflectivity,
    glass_geoms,
)
from sim.raycast import arccos
from slam import se2
from slam.errors import InvalidValueError

Float = NDArray[np.float64]
Hits = tuple[Float, NDArray[np.int64], Float]

__all__ = ["Lms221", "Lms221Config", "ScanResult"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanResult:
    """One scan, and the truth about it that only a simulator has.

    ranges       (n,) float32 m, as sent: inf no return (REP 117), NaN an error code
    true_ranges  (n,) float64 m, inf where nothing was hit
    geoms        (n,) int32 geom id, -1 where nothing was hit
    bodies       (n,) int32 body id, -1 likewise
    cosines      (n,) |cos| of the angle between beam and surface normal, NaN likewise
    mixed        (n,) bool, the range blends two surfaces

    Where the beam is a spot of several rays, ``true_ranges`` is that of the middle ray, and geoms,
    bodies and cosines are those of the strongest ray of the pulse that was measured.
    """

    ranges: NDArray[np.float32]
    true_ranges: Float
    geoms: NDArray[np.int32]
    bodies: NDArray[np.int32]
    cosines: Float
    mixed: NDArray[np.bool_]

    @property
    def incidence(self) -> NDArray[np.float32]:
        """(n,) rad between beam and surface normal, NaN where nothing was hit."""
        return arccos(self.cosines).astype(np.float32)


def _planar(position: Float, matrix: Float) -> tuple[float, float, float]:
    """(x m, y m, yaw rad) of a frame in the world; ``matrix`` (9,) by rows."""
    rows = matrix.tolist()
    x, y, _ = position.tolist()
    return x, y, math.atan2(rows[3], rows[0])


class Lms221:
    """The scanner on the site ``robot/laser`` of a model.

    ``rng`` is drawn from the same number of times for every scan, whatever is hit and whichever
    effects are on, so that a run's noise does not depend on what moves in the world.
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
        self._rng = np.random.default_rng(0) if rng is None else rng
        self._check_timestep(model)
        self._site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, site)
        if self._site < 0:
            raise InvalidValueError(f"Lms221.site: the model has no site {site!r}")
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        height = float(data.site_xpos[self._site][2])
        self.spec = self.config.spec(_mounting(model, data, self._site, robot))
        effects = self.config.effects
        self._signal = SignalModel(effects, self.config.systematic_bound_m, self._rng)
        panes = glass_geoms(model) if effects.glass else np.zeros(model.ngeom, dtype=np.bool_)

        def caster(only: NDArray[np.bool_]) -> Raycaster:
            return Raycaster(
                model,
                height=height,
                robot=robot,
                spot=self._signal.spot,
                range_max=self.config.mode.range_max_m,
                only=only,
            )

        self.caster = caster(~panes)
        self._panes = caster(panes) if panes.any() else None
        # The last entry of each, which index -1 takes, stands for no hit.
        self._body_of = np.append(model.geom_bodyid.astype(np.int32), np.int32(-1))
        self._ids = [np.append(c.ids, -1) for c in (self.caster, self._panes) if c is not None]
        self._beams = np.arange(self.spec.n_beams)
        self._reflectivity = np.append(geom_reflectivity(model), 0.0)
        self._fans = self._plan()

    def _check_timestep(self, model: mujoco.MjModel) -> None:
        wanted = 1.0 / (TURNS_PER_S * STEPS_PER_TURN)
        if not math.isclose(model.opt.timestep, wanted, rel_tol=1e-6):
            raise InvalidValueError(
                f"the model's timestep is {model.opt.timestep} s, expected 1/300 s: "
                "four steps are one turn of the mirror"
            )

    def _plan(self) -> dict[int, tuple[NDArray[np.int64], Float, Float]]:
        """Physics step of the scan -> (beams, angles, times within the step)."""
        degrees, turn = self.config.beams
        angles = self.spec.angles
        half = np.minimum(degrees // DEGREES_PER_STEP, STEPS_PER_SWEEP - 1).astype(np.int64)
        step = STEPS_PER_TURN * turn + half
        fans = {}
        for index in np.unique(step).tolist():
            beams = np.flatnonzero(step == index)
            taus = degrees[beams] / DEGREES_PER_STEP - half[beams]
            fans[index] = (beams.astype(np.int64), np.ascontiguousarray(angles[beams]), taus)
        return fans

    def observe(self, advance: Callable[[], None], data: mujoco.MjData) -> ScanResult:
        """Run one scan: ``config.steps`` calls of ``advance``, each one physics step of 1/300 s.

        ``data`` must have fresh kinematics on entry, and after every ``advance``.
        """
        casters = [c for c in (self.caster, self._panes) if c is not None]
        hits = [_misses(self.spec.n_beams, c.rays_per_beam) for c in casters]
        views = (data.site_xpos[self._site], data.site_xmat[self._site])
        after = None
        for step in range(self.config.steps):
            fan = self._fans.get(step)
            if fan is None:
                advance()
                after = None
                continue
            if after is None:
                for caster in casters:
                    caster.start(data)
                after = _planar(*views)
            before = after
            advance()
            after = _planar(*views)
            for caster, out in zip(casters, hits, strict=True):
                caster.cast(fan, (before, after), out)
        return self._result(
            [(d, ids[i], c) for ids, (d, i, c) in zip(self._ids, hits, strict=True)]
        )

    def _result(self, hits: list[Hits]) -> ScanResult:
        """What is sent, from (distances, geom ids, cosines) of the room and, if any, the panes."""
        distances, geoms, cosines = hits[0]
        reflectivity, transmission = self._reflectivity[geoms], np.ones(distances.shape)
        if len(hits) > 1:
            pane, pane_geoms, pane_cosines = hits[1]
            before = pane < distances
            mirror = before & (pane_cosines >= PANE_RETURN_COS)
            transmission[before & ~mirror] = PANE_TRANSMISSION**2
            distances, cosines = np.where(mirror, (pane, pane_cosines), (distances, cosines))
            geoms = np.where(mirror, pane_geoms, geoms)
            reflectivity = np.where(mirror, 1.0, reflectivity)
        ranges, rays, mixed = self._signal.apply(
            (distances, geoms, cosines), reflectivity, transmission
        )
        seen = np.where(rays < 0, np.int64(-1), geoms[self._beams, rays])
        return ScanResult(
            ranges=self._send(ranges),
            true_ranges=distances[:, 0],
            geoms=seen.astype(np.int32),
            bodies=self._body_of[seen],
            cosines=np.where(rays < 0, math.nan, cosines[self._beams, rays]),
            mixed=mixed,
        )

    def _send(self, ranges: Float) -> NDArray[np.float32]:
        """Add the statistical error, round to codes, leave out what the mode cannot say."""
        normal = self._rng.standard_normal(ranges.size)
        config, mode = self.config, self.config.mode
        # Rounding adds unit^2 / 12 of its own; what is sent shall have the stated deviation.
        rounding = mode.unit_m**2 / 12.0 if config.quantise else 0.0
        std = math.sqrt(max(config.noise_std_m**2 - rounding, 0.0))
        sent = np.maximum(ranges + std * normal, 0.0)
        limit = mode.range_max_m
        if config.quantise:
            codes = np.rint(sent / mode.unit_m)
            sent = codes * mode.unit_m
            limit = min(limit, mode.largest_code * mode.unit_m)
        sent[(sent > limit) | (ranges > limit)] = np.inf
        return sent.astype(np.float32)


def _misses(beams: int, rays: int) -> Hits:
    shape = (beams, rays)
    return np.full(shape, np.inf), np.full(shape, -1, dtype=np.int64), np.full(shape, np.nan)


def _mounting(model: mujoco.MjModel, data: mujoco.MjData, site: int, robot: str) -> Float:
    """``T_robot_laser`` from the model."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot)
    if body < 0:
        raise InvalidValueError(f"Lms221.robot: the model has no body {robot!r}")
    T_world_robot = _planar(data.xpos[body], data.xmat[body])
    return se2.between(T_world_robot, _planar(data.site_xpos[site], data.site_xmat[site]))
