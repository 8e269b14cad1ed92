# SPDX-License-Identifier: Apache-2.0
"""Sections 3.1 and 3.2 on real updates: energy, fixed points, times, the four characteristics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from slam.frontend.visibility import View
from slam.shunting.slam import ShuntingConfig
from slam.tracker.cells import FREE_COUNT, SIDE, TOUCHED_COUNT
from slam.tracker.network import Network

Array = NDArray[np.float64]
CELL, ACROSS = 0.1, 2  # blocks along an edge of the test fields
COUNT = ACROSS * SIDE
OPEN = View(math.tau / 8, np.full(8, 50.0), np.zeros(8), 50.0, 0.0, math.inf)
BLIND = View(math.tau / 8, np.zeros(8), np.zeros(8), 50.0, 0.0, math.inf)
ASIDE = np.array([-5.0, -5.0, 0.0])


def started(config: ShuntingConfig, x: Array) -> Network:
    """A network whose (COUNT, COUNT) neurons begin at activities ``x``."""
    network = Network(config)
    network.cover(0.0, 0.0, COUNT * CELL, COUNT * CELL)
    cells = network.cells
    for row in range(ACROSS):
        for column in range(ACROSS):
            cells.counts[FREE_COUNT] -= 1
            slot = int(cells.free[cells.counts[FREE_COUNT]])
            cells.directory[row - cells.corner[1], column - cells.corner[0]] = slot
            cells.x[slot] = x[row * SIDE :, column * SIDE :][:SIDE, :SIDE]
    return network


def inspired(network: Network, field: Array, step: float, view: View = OPEN) -> Array:
    """One update with input I = ``field``; the activities after it."""
    cells = network.cells
    for row in range(ACROSS):
        for column in range(ACROSS):
            k = row * ACROSS + column
            slot = int(cells.directory[row - cells.corner[1], column - cells.corner[0]])
            if slot < 0:
                continue
            count = int(cells.counts[TOUCHED_COUNT])
            cells.scratch_of[slot] = count
            cells.touched[count] = slot, column, row, 0
            cells.impression[count] = field[row * SIDE :, column * SIDE :][:SIDE, :SIDE]
            cells.counts[TOUCHED_COUNT] = count + 1
            assert count <= k
    network.integrate(view, ASIDE, step, write=True)
    return activities(network)


def activities(network: Network) -> Array:
    edge = (COUNT - 0.5) * CELL
    return network.window(0.5 * CELL, 0.5 * CELL, edge, edge)[0].astype(np.float64)


def energy(x: Array, given: Array, config: ShuntingConfig, mu: float) -> float:
    """V of Eq. (10) for activities ``x`` under inputs ``given``, both (rows, columns).

    V = - sum_i int b_i(e) d_i'(e) de - 1/2 sum_ij w_ij d_i d_j with d(x) = max(x - sigma, 0), so
    the integral runs from sigma to max(x, sigma); int b = -(A (x + ln(1 - x)) + I x).
    """
    A, upper = config.decay_per_s, np.maximum(x, config.threshold)

    def integral(at: Array) -> Array:
        return A * (at + np.log1p(-at)) + given * at

    d = upper - config.threshold
    rise = integral(upper) - integral(np.full_like(x, config.threshold))
    return float(-rise.sum() - 0.5 * (d * excited(d, mu, config.lateral_reach_cells)).sum())


def excited(d: Array, mu: float, reach: float) -> Array:
    """Sum over neighbours of w_ij d_j, zero outside the field."""
    edge = math.ceil(reach)
    padded, total = np.pad(d, edge), np.zeros_like(d)
    for dj in range(-edge, edge + 1):
        for di in range(-edge, edge + 1):
            if 0.0 < math.hypot(di, dj) < reach:
                near = padded[edge + dj :, edge + di :][: d.shape[0], : d.shape[1]]
                total += mu / math.hypot(di, dj) * near
    return total


def plain(**changes: float) -> ShuntingConfig:
    """Short-term memory alone."""
    return ShuntingConfig(cell_m=CELL, trace_s=0.0, short_term_weight=1.0, **changes)  # type: ignore[arg-type]


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    decay=st.floats(0.05, 5.0),
    share=st.floats(0.0, 0.95),
    reach=st.sampled_from([1.5, 2.5]),
    step=st.sampled_from([0.0267, 0.2, 1.0, 30.0]),
    seen=st.floats(0.0, 1.0),
    all_in_view=st.booleans(),
)
def test_energy_never_rises_along_updates(
    seed: int, decay: float, share: float, reach: float, step: float, seen: float, all_in_view: bool
) -> None:
    """V of Eq. (10), for any fixed input, start, weights and time step, hidden neurons or not."""
    rng = np.random.default_rng(seed)
    config = plain(decay_per_s=decay, lateral_sum=share * decay, lateral_reach_cells=reach)
    x = rng.uniform(0.0, 0.95, (COUNT, COUNT))
    field = rng.uniform(0.0, 1.0, (COUNT, COUNT)) * (rng.random((COUNT, COUNT)) < seen)
    network = started(config, x)
    view = OPEN if all_in_view else BLIND

    def value() -> float:
        return energy(activities(network), field.astype(np.float32), config, network.mu)

    energies = [value()]
    for _ in range(8):
        inspired(network, field, step, view)
        energies.append(value())
    scale = COUNT * COUNT * max(1.0, decay)
    assert np.diff(energies).max() <= 1e-7 * scale  # activities are stored in 32 bits


def test_sweeps_settle_where_every_neuron_is_at_its_own_equilibrium() -> None:
    """Whatever the order and the step: x = E / (A + E) with E = I + sum of w d(x), everywhere."""
    rng = np.random.default_rng(5)
    config = plain(lateral_sum=0.5, lateral_reach_cells=2.5)
    field = rng.uniform(0.05, 1.0, (COUNT, COUNT))
    settled = []
    for step, start in ((0.5, 0.0), (5.0, 0.9)):
        network = started(config, np.full((COUNT, COUNT), start))
        for _ in range(200):
            x = inspired(network, field, step)
        settled.append(x)
    np.testing.assert_allclose(settled[0], settled[1], atol=2e-6)
    x = settled[0]
    E = field + excited(np.maximum(x - config.threshold, 0.0), network.mu, 2.5)
    np.testing.assert_allclose(x, E / (0.8 + E), atol=2e-6)


@pytest.mark.parametrize(
    ("strength", "expected"), [(1.0, 0.556), (0.5, 0.385), (0.2, 0.2), (0.1, 0.111), (0.05, 0.059)]
)
def test_equilibrium_and_rise_of_every_strength(strength: float, expected: float) -> None:
    """x* = I / (A + I), reached with the rate A + I."""
    network = started(plain(), np.zeros((COUNT, COUNT)))
    field = np.full((COUNT, COUNT), strength)
    step = 0.005
    looks = round(1.0 / (0.8 + strength) / step)  # one time constant
    for _ in range(looks):
        x = inspired(network, field, step)
    assert x[3, 3] == pytest.approx(expected * (1.0 - math.exp(-1.0)), rel=0.01)
    for _ in range(9 * looks):
        x = inspired(network, field, step)
    assert x[3, 3] == pytest.approx(expected, abs=6e-4)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.floats(0.0, 0.9),
    step=st.sampled_from([0.0267, 0.2, 3.0]),
)
def test_a_higher_existence_probability_never_gives_a_lower_activity(
    seed: int, share: float, step: float
) -> None:
    """Characteristic 1: monotone in the input, whatever came before and beside."""
    rng = np.random.default_rng(seed)
    config = plain(lateral_sum=share * 0.8)
    start = rng.uniform(0.02, 0.9, (COUNT, COUNT))
    low, high = started(config, start), started(config, start)
    for _ in range(6):
        less = rng.uniform(0.02, 1.0, (COUNT, COUNT))
        more = less + (1.0 - less) * rng.uniform(0.0, 1.0, (COUNT, COUNT))
        x, y = inspired(low, less, step), inspired(high, more, step)
        assert (y >= x - 1e-6).all()


def test_what_is_static_grows_and_what_moved_fades() -> None:
    """Characteristics 2 and 3: confidence rises look by look; gone, it falls look by look."""
    network = started(plain(), np.zeros((COUNT, COUNT)))
    thing = np.zeros((COUNT, COUNT))
    thing[4:7, 0:3] = 0.9
    rising = [inspired(network, thing, 0.1)[5, 1] for _ in range(20)]
    assert (np.diff(rising) > 0.0).all()
    moved = np.roll(thing, 4, axis=1)
    steps = [inspired(network, moved, 0.1) for _ in range(60)]
    left, now = [x[5, 1] for x in steps], [x[5, 5] for x in steps]
    assert (np.diff(left)[: np.flatnonzero(np.array(left) > 0.0)[-1]] < 0.0).all()
    assert left[-1] == 0.0
    assert (np.diff(now) > 0.0).all()


def test_confidence_rises_when_a_loop_closes() -> None:
    """Characteristic 4: seen briefly, out of sight for long, seen again: more sure than ever."""
    config = ShuntingConfig(cell_m=CELL)
    network = started(config, np.zeros((COUNT, COUNT)))
    field = np.full((COUNT, COUNT), 0.8)
    for _ in range(5):
        inspired(network, field, 0.1)
    first = [a.copy() for a in network.window(0.5 * CELL, 0.5 * CELL, 1.0, 1.0)]
    nothing = np.zeros((COUNT, COUNT))
    for _ in range(100):
        inspired(network, nothing, 0.1, BLIND)
    away = network.window(0.5 * CELL, 0.5 * CELL, 1.0, 1.0)
    for before, after in zip(first, away, strict=True):
        np.testing.assert_array_equal(after, before)
    inspired(network, field, 0.1)
    for before, after in zip(first, network.window(0.5 * CELL, 0.5 * CELL, 1.0, 1.0), strict=True):
        assert (after > before).all()


def test_the_slope_of_the_energy_is_minus_b() -> None:
    """dV/dx = -b(x) = A x / (1 - x) - I of Eq. (9), for a lone neuron above the threshold."""
    x, field, h = np.array([[0.3]]), np.array([[0.7]]), 1e-6
    rise = energy(x + h, field, plain(), 0.0) - energy(x - h, field, plain(), 0.0)
    assert rise / (2.0 * h) == pytest.approx(0.8 * 0.3 / 0.7 - 0.7, rel=1e-6)
