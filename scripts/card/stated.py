# SPDX-License-Identifier: Apache-2.0
"""The sensor card of any scanner with a data sheet: what is stated, and what is measured."""

import math
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np

from scripts.card.rows import Bench, Row, box, plate
from sim.sensors.lidar.registry import names, scanner_of
from sim.sensors.lidar.scanner import Scanner, Spot
from sim.sensors.lidar.sheet import QUANTITIES, Stated, sheet_of
from slam.errors import InvalidValueError
from slam.frames import Float

UNITS = 40  # whose systematic errors are drawn
WITHIN = 0.05  # of a deviation found by sampling
STEPS_PER_S = 300
UNIT_OF = {"deg": ("°", 1.0), "hz": ("Hz", 1.0), "us": ("µs", 1.0), "m": ("mm", 1e3)}


def rows_of(name: str) -> list[Row]:
    """Every row of a scanner's data sheet, measured again; a few seconds.

    Raises ``InvalidValueError`` for a scanner without a data sheet, and for one with settings or
    errors in its name; ``UnknownNameError`` for one that is not registered.
    """
    if name not in names():
        scanner_of(name)  # says what is wrong with a name that is none
        raise InvalidValueError(
            f"a sensor card shows a whole model, one of {', '.join(names())}; got {name!r}"
        )
    sheet = sheet_of(name)
    if not sheet:
        raise InvalidValueError(f"scanner '{name}' has no data sheet to be measured against")
    model = scanner_of(name).scanner()
    return [_row(model, stated) for stated in sheet]


def _row(model: Scanner, stated: Stated) -> Row:
    what = QUANTITIES[stated.what]
    if stated.at_m is not None:
        what += f" at {stated.at_m:g} m"
    if stated.value is not None:
        measured = _MEASURES[stated.what](model, stated.at_m or 0.0)
        words = _printed(stated.what, measured)
        return Row(what, stated.text, words, stated.source, _kept(stated, measured))
    words = "the model has none"
    if stated.what in ("range_min_m", "unit_m") and getattr(model, stated.what):
        words = f"{1e3 * getattr(model, stated.what):g} mm"
    return Row(what, stated.text, words, stated.source, kept=True)


def _kept(stated: Stated, measured: float | str) -> bool:
    if isinstance(stated.value, str) or isinstance(measured, str):
        return measured == stated.value
    assert stated.value is not None
    if stated.what == "systematic_m":  # a bound, of which the worst of some units comes near
        return 0.4 * stated.value < measured <= stated.value + 1e-6
    usual = WITHIN if stated.what == "noise_m" else 1e-3
    return math.isclose(measured, stated.value, rel_tol=stated.within or usual)


def _printed(what: str, measured: float | str) -> str:
    if isinstance(measured, str):
        return measured
    suffix, scale = UNIT_OF.get(what.rsplit("_", 1)[-1], ("", 1.0))
    words = f"{float(f'{scale * measured:.4g}'):g} {suffix}".strip()
    return f"{words}, worst of {UNITS} units" if what == "systematic_m" else words


def _field_of_view(model: Scanner, _: float) -> float:
    """Degrees; all round, the beam after the last is the first again."""
    spec = model.spec()
    increment = math.degrees(spec.angle_increment)
    return increment * (spec.n_beams - (increment * spec.n_beams < 359.9))


def _direction(model: Scanner, _: float) -> str:
    return "clockwise" if model.times_s[0] > model.times_s[-1] else "counter-clockwise"


def _sent(model: Scanner, world: str) -> str:
    """For the beam ahead, in one scan of a world."""
    sent = str(Bench(world, model).scan().ranges[_middle(model)])
    return "NaN" if sent == "nan" else sent


def _middle(model: Scanner) -> int:
    """The beam ahead."""
    return int(np.argmin(np.abs(model.spec().angles)))


def _rate(model: Scanner, _: float) -> float:
    """Scans over the physics steps that they took, of so many that these are whole."""
    scans = Fraction(model.period_s * STEPS_PER_S).denominator
    bench = Bench(plate(3.0), model)
    for _ in range(scans):
        bench.scan()
    return scans * STEPS_PER_S / bench.steps


def _limit(model: Scanner, limit_m: float) -> float:
    """Where a plate ahead begins or ends to be measured, by bisection about the limit."""
    bare = model.only("ideal")
    ahead = _middle(model)

    def seen(distance: float) -> bool:
        return bool(np.isfinite(Bench(plate(distance, 0.2), bare).scan().ranges[ahead]))

    low, high = 0.5 * limit_m, 1.5 * limit_m
    rises = seen(high)
    for _ in range(18):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if seen(middle) == rises else (middle, high)
    return 0.5 * (low + high)


def _ahead(model: Scanner, distance: float, scans: int) -> tuple[Float, Float]:
    """(sent, true) m of the beams within 10 degrees of a plate's normal."""
    bench = Bench(plate(distance), model, seed=1)
    ahead = np.abs(model.spec().angles) < math.radians(10.0)
    results = [bench.scan() for _ in range(scans)]
    sent = [result.ranges[ahead].astype(np.float64) for result in results]
    return np.concatenate(sent), np.concatenate([result.true_ranges[ahead] for result in results])


def _noise(model: Scanner, distance: float) -> float:
    """Deviation of what is sent, every other error off."""
    sent, true = _ahead(model.only("noise"), distance, 200)
    return float((sent - true).std())


def _systematic(model: Scanner, distance: float) -> float:
    """The worst of ``UNITS`` units that look along a wall, from half to one and a half times as
    far; within the band of that distance."""
    smooth = replace(model, noise=(), unit_m=0.0, spot=Spot(), mixed_pixels=False)
    edges = [0.0, *(band.up_to_m for band in model.systematic)]
    band = max(k for k, edge in enumerate(edges[:-1]) if edge < distance)
    low, high = max(0.5 * distance, edges[band] + 0.1), min(1.5 * distance, edges[band + 1] - 0.1)
    worst = 0.0
    for seed in range(UNITS):
        result = Bench(box(0.0, 1.05, 40.0, 0.05), smooth, seed).scan()
        inside = (result.true_ranges > low) & (result.true_ranges < high)
        error = np.abs(result.ranges[inside] - result.true_ranges[inside])
        worst = max(worst, float(error.max(initial=0.0)))
    return worst


def _spot_sizes(model: Scanner, distance: float) -> tuple[float, float]:
    """Width and height m of the ellipse with the rays' second moments (as ISO 11146)."""
    spot = model.spot
    moments = np.array(spot.weights) @ np.array(spot.offsets) ** 2
    wide, high = 2.0 * np.sqrt(moments) * spot.size_at(distance)
    return float(wide), float(high)


def _unit(model: Scanner, _: float) -> float:
    """The step of the codes: the largest of which all values sent are multiples."""
    sent = _ahead(model.only("noise"), 0.5 * model.range_max_m, 20)[0]
    tick = 2.5e-5  # far finer than any code
    codes = np.unique(np.rint(sent[np.isfinite(sent)] / tick).astype(np.int64))
    return float(np.gcd.reduce(np.diff(codes))) * tick


# By quantity of a data sheet, what the simulated scanner does: of its model and a distance in m.
_MEASURES: dict[str, Callable[[Scanner, float], float | str]] = {
    "direction": _direction,
    "too_near": lambda model, _: _sent(model, plate(0.5 * model.range_min_m, 0.01)),
    "no_return": lambda model, _: _sent(model, ""),
    "field_of_view_deg": _field_of_view,
    "n_beams": lambda model, _: float(Bench(plate(3.0), model).scan().ranges.size),
    "step_deg": lambda model, _: math.degrees(model.spec().angle_increment),
    "rate_hz": _rate,
    "beam_to_beam_us": lambda model, _: (
        1e6 * float(np.abs(np.diff(model.spec().beam_time_offsets)).mean())
    ),
    "range_min_m": lambda model, _: _limit(model, model.range_min_m),
    "range_max_m": lambda model, _: _limit(model, model.range_max_m),
    "noise_m": _noise,
    "systematic_m": _systematic,
    "unit_m": _unit,
    "spot_width_m": lambda model, at_m: _spot_sizes(model, at_m)[0],
    "spot_height_m": lambda model, at_m: _spot_sizes(model, at_m)[1],
}
