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
from types import MappingProxyType

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.caster import Raycaster
from sim.raycast import arccos
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, LaserSpec

Float = NDArray[np.float64]

TURNS_PER_S = 75
STEPS_PER_TURN = 4
STEPS_PER_SWEEP = 2
DEGREES_PER_STEP = 90.0


@dataclass(frozen=True, kw_only=True)
class RangeMode:
    """One way the device codes distance (TL table 3-7): unit m and largest code that is a range."""

    unit_m: float
    largest_code: int
    range_max_m: float


RANGE_MODES = MappingProxyType(
    {
        "8m": RangeMode(unit_m=0.001, largest_code=8182, range_max_m=8.182),
        "16m": RangeMode(unit_m=0.001, largest_code=16374, range_max_m=16.374),
        "32m": RangeMode(unit_m=0.001, largest_code=32758, range_max_m=32.758),
        "80m": RangeMode(unit_m=0.01, largest_code=8182, range_max_m=80.0),
    }
)

# (resolution, field of view) -> mirror turns (TD p10, TL p19, p48).
SCAN_MODES = MappingProxyType({1.0: 1, 0.5: 2, 0.25: 4})


@dataclass(frozen=True, kw_only=True)
class Lms221Config:
    """How the scanner is set, and how it errs.

    resolution_deg  1, 0.5 or 0.25: 1, 2 or 4 mirror turns per scan (75, 37.5, 18.75 scans/s)
    fov_deg         180, or the middle 100
    range_mode      "8m", "16m", "32m" (1 mm codes) or "80m" (1 cm codes, as delivered, TL 10-12)
    noise_std_m     statistical error of what is sent, rounding included (TD p34: 10 mm, 1..20 m)
    quantise        round to the code of the range mode
    """

    resolution_deg: float = 0.5
    fov_deg: int = 180
    range_mode: str = "80m"
    noise_std_m: float = 0.010
    quantise: bool = True

    def __post_init__(self) -> None:
        if self.resolution_deg not in SCAN_MODES:
            raise InvalidValueError(
                f"Lms221Config.resolution_deg must be 1, 0.5 or 0.25, got {self.resolution_deg}"
            )
        if self.fov_deg not in (100, 180):
            raise InvalidValueError(f"Lms221Config.fov_deg must be 100 or 180, got {self.fov_deg}")
        if self.range_mode not in RANGE_MODES:
            raise InvalidValueError(
                f"Lms221Config.range_mode must be one of {', '.join(RANGE_MODES)}, "
                f"got {self.range_mode!r}"
            )
        if not 0.0 <= self.noise_std_m <= 1.0:
            raise InvalidValueError(
                f"Lms221Config.noise_std_m must be within 0..1 m, got {self.noise_std_m}"
            )

    @classmethod
    def ideal(cls, *, resolution_deg: float = 0.5, fov_deg: int = 180) -> Lms221Config:
        """Geometry and timing of the device, exact ranges."""
        return cls(resolution_deg=resolution_deg, fov_deg=fov_deg, noise_std_m=0.0, quantise=False)

    @property
    def turns(self) -> int:
        """Mirror turns per scan."""
        return SCAN_MODES[self.resolution_deg]

    @property
    def steps(self) -> int:
        """Physics steps per scan."""
        return STEPS_PER_TURN * self.turns

    @property
    def sweep_steps(self) -> int:
        """Physics steps from the start of a scan to its last beam."""
        return STEPS_PER_TURN * (self.turns - 1) + STEPS_PER_SWEEP

    @property
    def mode(self) -> RangeMode:
        """The range mode's unit and limits."""
        return RANGE_MODES[self.range_mode]

    @property
    def beams(self) -> tuple[Float, NDArray[np.int64]]:
        """((n,) degrees of the mirror, (n,) turn) of every beam, counter-clockwise."""
        first = (180 - self.fov_deg) // 2
        count = round(self.fov_deg / self.resolution_deg) + 1
        index = np.arange(count, dtype=np.int64)
        degrees = np.asarray(first + index * self.resolution_deg, dtype=np.float64)
        return degrees, index % self.turns

    @property
    def stamp_offset_ns(self) -> int:
        """From the start of the scan's first physics step to its earliest beam, ns."""
        return round(float(self.beams[0][0]) / 360.0 / TURNS_PER_S * NS_PER_S)

    def spec(self, T_robot_laser: Float | None = None) -> LaserSpec:
        """Geometry and exact beam times: the beam at angle a in turn k is k/75 + (a/360)/75 s."""
        degrees, turn = self.beams
        times = (turn + degrees / 360.0) / TURNS_PER_S
        return LaserSpec(
            n_beams=degrees.size,
            angle_min=math.radians(-self.fov_deg / 2),
            angle_increment=math.radians(self.resolution_deg),
            range_min=0.0,
            range_max=self.mode.range_max_m,
            beam_time_offsets=times - times[0],
            T_robot_laser=np.zeros(3) if T_robot_laser is None else T_robot_laser,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanResult:
    """One scan, and the truth about it that only a simulator has.

    ranges       (n,) float32 m, as sent: inf no return (REP 117), NaN an error code
    true_ranges  (n,) float64 m, inf where nothing was hit
    geoms        (n,) int32 geom id, -1 where nothing was hit
    bodies       (n,) int32 body id, -1 likewise
    cosines      (n,) |cos| of the angle between beam and surface normal, NaN likewise
    """

    ranges: NDArray[np.float32]
    true_ranges: Float
    geoms: NDArray[np.int32]
    bodies: NDArray[np.int32]
    cosines: Float

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
        self.caster = Raycaster(
            model, height=height, robot=robot, range_max=self.config.mode.range_max_m
        )
        # The last entry, which index -1 takes, stands for no hit.
        self._geom_of = np.append(self.caster.ids.astype(np.int32), np.int32(-1))
        self._body_of = np.append(model.geom_bodyid.astype(np.int32), np.int32(-1))
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
        n, k = self.spec.n_beams, self.caster.rays_per_beam
        hits = (
            np.full((n, k), np.inf),
            np.full((n, k), -1, dtype=np.int64),
            np.full((n, k), np.nan),
        )
        views = (data.site_xpos[self._site], data.site_xmat[self._site])
        after = None
        for step in range(self.config.steps):
            fan = self._fans.get(step)
            if fan is None:
                advance()
                after = None
                continue
            if after is None:
                self.caster.start(data)
                after = _planar(*views)
            before = after
            advance()
            after = _planar(*views)
            self.caster.cast(fan, (before, after), hits)
        return self._result(hits)

    def _result(self, hits: tuple[Float, NDArray[np.int64], Float]) -> ScanResult:
        true_ranges, geoms, cosines = hits[0][:, 0], self._geom_of[hits[1][:, 0]], hits[2][:, 0]
        return ScanResult(
            ranges=self._measure(true_ranges),
            true_ranges=true_ranges,
            geoms=geoms,
            bodies=self._body_of[geoms],
            cosines=cosines,
        )

    def _measure(self, true_ranges: Float) -> NDArray[np.float32]:
        """What the device sends for these distances."""
        normal = self._rng.standard_normal(true_ranges.size)
        config, mode = self.config, self.config.mode
        # Rounding adds unit^2 / 12 of its own; what is sent shall have the stated deviation.
        rounding = mode.unit_m**2 / 12.0 if config.quantise else 0.0
        std = math.sqrt(max(config.noise_std_m**2 - rounding, 0.0))
        ranges = np.maximum(true_ranges + std * normal, 0.0)
        limit = mode.range_max_m
        if config.quantise:
            codes = np.rint(ranges / mode.unit_m)
            ranges = codes * mode.unit_m
            limit = min(limit, mode.largest_code * mode.unit_m)
        ranges[(ranges > limit) | (true_ranges > limit)] = np.inf
        return ranges.astype(np.float32)


def _mounting(model: mujoco.MjModel, data: mujoco.MjData, site: int, robot: str) -> Float:
    """``T_robot_laser`` from the model."""
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, robot)
    if body < 0:
        raise InvalidValueError(f"Lms221.robot: the model has no body {robot!r}")
    T_world_robot = _planar(data.xpos[body], data.xmat[body])
    return se2.between(T_world_robot, _planar(data.site_xpos[site], data.site_xmat[site]))
