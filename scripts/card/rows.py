# SPDX-License-Identifier: Apache-2.0
"""The rows of the sensor card: what our scanner does, beside what its data sheet says.

TD is the manufacturer's technical description (8008970/06-2003), TL his telegram listing
(8007954/2006-08-01), STW the ROS driver sicktoolbox_wrapper.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from scripts.pages.table import Cell
from sim.sensors.lidar.device import LaserScanner, ScanResult
from sim.sensors.lidar.link import SerialLink
from sim.sensors.lidar.models.lms221 import (
    LMS221_SPOT,
    NEEDED,
    RANGE_MODES,
    Lms221Config,
    RangeEffects,
)
from sim.sensors.lidar.receiver import SignalModel
from sim.sensors.lidar.registry import ScannerConfig

HEADINGS = ("", "what", "data sheet", "measured", "source")
MARKS = {True: Cell(text="✓", mark="better"), False: Cell(text="✗", mark="worse")}
HEIGHT = 0.36
NONE = RangeEffects.none()
MATERIALS = ("wall", "paper", "rubber", "metal", "glass", "mirror", "trousers", "plastic_black")
_FRAME = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.0033333333333333335" gravity="0 0 0"/>
  <asset>{assets}</asset>
  <worldbody>
    <body name="robot/base"><site name="robot/laser" pos="0 0 {height}"/></body>
    {world}
  </worldbody>
</mujoco>
"""


class Row(NamedTuple):
    """One line of a card; ``kept`` whether what was measured agrees with the data sheet."""

    what: str
    datasheet: str
    measured: str
    source: str
    kept: bool

    def cells(self) -> list[Cell]:
        """Under ``HEADINGS``."""
        return [MARKS[self.kept], *(Cell(text=text) for text in self[:4])]


def box(x: float, y: float, half_x: float, half_y: float, material: str = "wall") -> str:
    """MJCF of an upright box 2 m high."""
    return f'<geom type="box" size="{half_x} {half_y} 1" pos="{x} {y} 1" material="{material}"/>'


def post(x: float, y: float, radius: float, material: str = "metal") -> str:
    """MJCF of an upright cylinder 1 m high."""
    return f'<geom type="cylinder" size="{radius} .5" pos="{x} {y} .5" material="{material}"/>'


def plate(distance: float, half: float = 30.0) -> str:
    """A wall square to the beam ahead."""
    return box(distance + 0.05, 0.0, 0.05, half)


class Bench:
    """One scanner before one set of things; ``scan`` as often as wanted."""

    def __init__(self, world: str, config: ScannerConfig | None = None, seed: int = 0) -> None:
        assets = "".join(f'<material name="{name}"/>' for name in MATERIALS)
        text = _FRAME.format(assets=assets, height=HEIGHT, world=world)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        self.laser = LaserScanner(self.model, config, np.random.default_rng(seed))
        self.steps = 0

    def _advance(self) -> None:
        self.steps += 1

    def scan(self) -> ScanResult:
        """One scan of a world at rest."""
        return self.laser.observe(self._advance, self.data)

    def ranges(self, scans: int) -> NDArray[np.float64]:
        """(scans, beams) values sent, m."""
        return np.array([self.scan().ranges for _ in range(scans)], dtype=np.float64)


def only(switches: Mapping[str, bool] | None = None, **settings: object) -> Lms221Config:
    """A config with no effect but the named ones; ``settings`` as for ``Lms221Config``."""
    effects = replace(NONE, **(switches or {}))
    defaults: dict[str, object] = {"noise_std_m": 0.0, "quantise": False}
    return Lms221Config(**{**defaults, **settings}, effects=effects)  # type: ignore[arg-type]


# By distance, m: TL table 10-1.
SPOT_CM = {1.0: 3.0, 2.0: 4.0, 3.0: 6.0, 5.0: 8.0, 8.0: 12.0, 10.0: 14.0, 20.0: 26.0}
MODES = {  # resolution and field of view, degrees: values, scans per second
    (1.0, 180): (181, 75.0), (0.5, 180): (361, 37.5), (0.25, 180): (721, 18.75),
    (1.0, 100): (101, 75.0), (0.5, 100): (201, 37.5), (0.25, 100): (401, 18.75),
}  # fmt: skip
LINKED = ((0.25, 100), (0.5, 180), (1.0, 180))
NOTHING_MIRRORED = (np.empty(0), np.empty(0, dtype=np.int64), np.empty(0))


def rows() -> list[Row]:
    """All rows, measured again; about ten seconds."""
    parts = (modes(), timing(), noise(), systematic(), spot(), reflectivity(), codes(), link())
    return [row for part in parts for row in part]


def modes() -> Iterator[Row]:
    """Beams and scan rates of every mode."""
    for (resolution, fov), (beams, rate) in MODES.items():
        config = Lms221Config.ideal(resolution_deg=resolution, fov_deg=fov)
        bench = Bench(plate(3.0), config)
        seen = bench.scan().ranges.size
        hertz = 300.0 / bench.steps
        yield Row(
            f"{resolution:g}° over {fov}°: values, scans per second",
            f"{beams}, {rate:g}", f"{seen}, {hertz:g}",
            "TD p10, TL p19, p47", seen == beams and hertz == rate,
        )  # fmt: skip


def timing() -> Iterator[Row]:
    """The mirror."""
    offsets = Lms221Config(resolution_deg=0.5).spec().beam_time_offsets
    per_degree, gap = float(offsets[2] - offsets[0]), float(offsets[1] - offsets[0])
    yield Row(
        "time per degree of the mirror", "37.0 µs (13.32 ms / 360)", f"{per_degree * 1e6:.2f} µs",
        "TD p10; STW", abs(per_degree - 37.0e-6) < 0.1e-6,
    )  # fmt: skip
    yield Row(
        "neighbours in a 0.5° scan lie apart", "13.32 ms + 18.5 µs", f"{gap * 1e3:.2f} ms",
        "TL p19, p47", abs(gap - 13.34e-3) < 0.03e-3,
    )  # fmt: skip


def noise() -> Iterator[Row]:
    """Statistical error: every effect on, a white wall, beams near its normal."""
    for mode in ("32m", "80m"):
        for distance in (1.0, 5.0, 10.0, 20.0):
            bench = Bench(plate(distance), Lms221Config(range_mode=mode), seed=int(distance))
            std = math.sqrt(float(bench.ranges(250)[:, 172:189].var(axis=0, ddof=1).mean()))
            yield Row(
                f"statistical error at {distance:g} m, {mode} mode, one sigma",
                "10 mm", f"{std * 1e3:.1f} mm", "TD p34", abs(std - 0.010) < 0.0008,
            )  # fmt: skip


def systematic() -> Iterator[Row]:
    """The part that averaging does not remove: each unit looks along a wall, 1 to 20 m away."""
    for mode, bound in (("32m", 0.035), ("80m", 0.05)):
        config = only({"systematic": True}, range_mode=mode, resolution_deg=0.25)
        worst = 0.0
        for seed in range(100):
            result = Bench(box(0.0, 1.05, 40.0, 0.05), config, seed).scan()
            inside = (result.true_ranges >= 1.0) & (result.true_ranges <= 20.0)
            error = result.ranges[inside].astype(np.float64) - result.true_ranges[inside]
            worst = max(worst, float(np.abs(error).max()))
        yield Row(
            f"systematic error, {mode} mode, worst of 100 units, 1 to 20 m",
            f"± {bound * 1e3:g} mm", f"{worst * 1e3:.1f} mm",
            "TD p34", 0.5 * bound < worst <= bound + 1e-6,
        )  # fmt: skip


def spot() -> Iterator[Row]:
    """What a beam lights: the disc that has the rays' second moment (4 deviations, ISO 11146)."""
    weights, offsets = np.array(LMS221_SPOT.weights), np.array(LMS221_SPOT.offsets)
    spread = math.sqrt(float((weights * offsets[:, 0] ** 2).sum()))
    for distance, centimetres in SPOT_CM.items():
        radius = LMS221_SPOT.aperture + LMS221_SPOT.divergence * distance
        diameter = 400.0 * radius * spread
        yield Row(
            f"spot at {distance:g} m", f"{centimetres:g} cm (16 mm + 11.9 mrad, rounded up)",
            f"{diameter:.1f} cm", "TL table 10-1, p114", abs(diameter - centimetres) < 0.95,
        )  # fmt: skip


def least_reflectivity(distance: float) -> float:
    """Of a full target square to the beam, by bisection on the scanner itself."""
    config = only({"spot": True, "reflectivity": True})
    bench = Bench(plate(distance), config)
    bench.scan()
    ranges, found, cosines = bench.laser.caster.hits
    ahead = (ranges[:, 180:181].copy(), found[:, 180:181].copy(), cosines[:, 180:181].copy())
    low, high = 1e-3, 3.0
    for _ in range(30):
        middle = math.sqrt(low * high)
        surface = (np.array([middle]), np.array([False]), np.zeros(1, int), np.zeros(1, int))
        receiver = SignalModel(config.scanner(), surface, np.random.default_rng(0))
        sent = receiver.scan(ahead, NOTHING_MIRRORED).ranges[0]
        low, high = (low, middle) if np.isfinite(sent) else (middle, high)
    return high


def reflectivity() -> Iterator[Row]:
    """What is needed for a return."""
    for distance, needed in NEEDED:
        found = least_reflectivity(distance)
        yield Row(
            f"needed reflectivity at {distance:g} m", f"{100 * needed:.1f} %",
            f"{100 * found:.1f} %", "TD fig. 4-2", abs(found / needed - 1.0) < 0.05,
        )  # fmt: skip
    reach = next(d for d in np.arange(20.0, 40.0, 0.25).tolist() if least_reflectivity(d) > 0.10)
    yield Row(
        "range at 10 % reflectivity", "30 m", f"{reach:.1f} m", "TD p33", abs(reach - 30.0) < 2.0
    )


def codes() -> Iterator[Row]:
    """Steps and codes of the range modes."""
    for mode, limits in RANGE_MODES.items():
        config = replace(
            Lms221Config.noise_only(range_mode=mode), effects=replace(NONE, error_codes=True)
        )
        top = limits.range_max_m
        sent = Bench(plate(0.9 * top, 200.0), config).ranges(3)[:, 175:186]
        unit = limits.unit_m
        on_grid = bool(np.allclose(sent / unit, np.rint(sent / unit), atol=2e-3))
        beyond = Bench(plate(top + 0.5, 200.0), config).scan().ranges[180]
        nothing = Bench("", config).scan().ranges[180]
        step = f"{1e3 * unit:g} mm" if on_grid else "off the grid"
        yield Row(
            f"{mode} mode: step; beyond {top:g} m; no return", f"{1e3 * unit:g} mm; +inf; NaN",
            f"{step}; {beyond:+f}; {'NaN' if np.isnan(nothing) else nothing}",
            "TL table 3-7, 10.8; STW", on_grid and beyond == np.inf and bool(np.isnan(nothing)),
        )  # fmt: skip


def link() -> Iterator[Row]:
    """Scans lost on the serial link."""
    for baud, lost in ((9_600, (16, 29, 30)), (38_400, (4, 8, 8)), (500_000, (0, 0, 0))):
        modes_ = (Lms221Config(resolution_deg=r, fov_deg=f) for r, f in LINKED)
        ours = tuple(SerialLink(baud=baud, config=config).lost_scans for config in modes_)
        yield Row(
            f"scans lost between two at {baud / 1000:g} kBd: 0.25°, 0.5°, 1°",
            ", ".join(map(str, lost)), ", ".join(map(str, ours)), "TL table 10-17", ours == lost,
        )  # fmt: skip
