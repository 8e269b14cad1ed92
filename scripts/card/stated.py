# SPDX-License-Identifier: Apache-2.0
"""The sensor card of any scanner with a data sheet: what is stated, and what is measured."""

import math
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
        measured, words = _measured(model, stated)
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


def _measured(model: Scanner, stated: Stated) -> tuple[float | str, str]:
    """What the simulated scanner does: as a number or a word, and as it is printed."""
    spec, at = model.spec(), stated.at_m or 0.0
    increment = math.degrees(spec.angle_increment)
    if stated.what in ("direction", "too_near", "no_return"):
        word = _word(model, stated.what)
        return word, word
    value = {
        "field_of_view_deg": lambda: (
            increment * (spec.n_beams - (increment * spec.n_beams < 359.9))
        ),
        "n_beams": lambda: float(Bench(plate(3.0), model).scan().ranges.size),
        "step_deg": lambda: increment,
        "rate_hz": lambda: _rate(model),
        "beam_to_beam_us": lambda: 1e6 * float(np.abs(np.diff(spec.beam_time_offsets)).mean()),
        "range_min_m": lambda: _limit(model, model.range_min_m),
        "range_max_m": lambda: _limit(model, model.range_max_m),
        "noise_m": lambda: _noise(model, at),
        "systematic_m": lambda: _systematic(model, at),
        "unit_m": lambda: _unit(model),
        "spot_width_m": lambda: _spot_sizes(model, at)[0],
        "spot_height_m": lambda: _spot_sizes(model, at)[1],
    }[stated.what]()
    suffix, scale = UNIT_OF.get(stated.what.rsplit("_", 1)[-1], ("", 1.0))
    words = f"{float(f'{scale * value:.4g}'):g} {suffix}".strip()
    return value, f"{words}, worst of {UNITS} units" if stated.what == "systematic_m" else words


def _word(model: Scanner, what: str) -> str:
    times = model.times_s
    if what == "direction":
        return "clockwise" if times[0] > times[-1] else "counter-clockwise"
    near = plate(0.5 * model.range_min_m, 0.01)
    bench = Bench(near if what == "too_near" else "", model)
    sent = str(bench.scan().ranges[_middle(model)])
    return "NaN" if sent == "nan" else sent


def _middle(model: Scanner) -> int:
    """The beam ahead."""
    return int(np.argmin(np.abs(model.spec().angles)))


def _rate(model: Scanner) -> float:
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


def _unit(model: Scanner) -> float:
    """The step of the codes: the largest of which all values sent are multiples."""
    sent, _ = _ahead(model.only("noise"), 0.5 * model.range_max_m, 20)
    tick = 2.5e-5  # far finer than any code
    codes = np.unique(np.rint(sent[np.isfinite(sent)] / tick).astype(np.int64))
    return float(np.gcd.reduce(np.diff(codes))) * tick
