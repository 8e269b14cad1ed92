# SPDX-License-Identifier: Apache-2.0
"""Eq. (8) against closed forms: equilibria, times, bounds, shape, visibility."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam import se2
from slam.errors import InvalidValueError
from slam.frontend.observations import Observations
from slam.frontend.visibility import View, view_of_beams, view_of_features
from slam.shunting.slam import ShuntingConfig
from slam.tracker.network import Network, lateral_mu
from slam.tracker.rasterise import rasterise

ORIGIN = np.zeros(3)
BLIND = View(math.tau / 8, np.zeros(8), np.zeros(8), 400.0, 0.0, math.inf)
OPEN = View(math.tau / 8, np.full(8, 20.0), np.zeros(8), 20.0, 0.0, math.inf)


def point(x: float, y: float, cell: float, view: View = BLIND) -> Observations:
    variance = (0.8 * cell) ** 2
    return Observations(
        points_robot=np.array([[x, y]]),
        covariances=np.array([[variance, 0.0, variance]]),
        shares=np.ones(1),
        tangents=np.zeros((1, 2)),
        joined=np.zeros(1, np.bool_),
        facings=np.zeros(1, np.uint8),
        view=view,
        T_robot_laser=np.zeros(3),
    )


def look(network: Network, observations: Observations | None, step: float) -> None:
    """One update, with an observation or with an empty view over everything."""
    if observations is not None:
        rasterise(network, observations, ORIGIN)
    view = OPEN if observations is None else observations.view
    network.integrate(view, np.array([-5.0, 0.0, 0.0]), step, write=True)


def activity(network: Network, x: float, y: float) -> float:
    return float(network.window(x, y, x, y)[0][0, 0])


def test_an_empty_look_decays_with_the_rate_A_whatever_the_scan_rate() -> None:
    for step in (0.01, 0.0267):
        network = Network(ShuntingConfig(cell_m=0.1))
        look(network, point(1.05, 2.05, 0.1), 3.0)
        start = activity(network, 1.05, 2.05)
        for _ in range(round(1.0 / step)):
            look(network, None, step)
        assert activity(network, 1.05, 2.05) == pytest.approx(start * math.exp(-0.8), rel=0.02)


def test_what_moved_fades_until_its_block_dies() -> None:
    network = Network(ShuntingConfig(cell_m=0.1, trace_s=0.0))
    look(network, point(1.05, 2.05, 0.1), 1.0)
    alive = int((network.cells.directory >= 0).sum())
    for _ in range(40):
        look(network, None, 0.2)
    assert alive > 0
    assert int((network.cells.directory >= 0).sum()) == 0


def test_the_trace_freezes_what_stays_and_lets_go_of_what_passed() -> None:
    network = Network(ShuntingConfig(cell_m=0.1))
    for k in range(50):
        look(network, point(1.05, 2.05, 0.1), 0.2)
        if k < 3:
            look(network, point(3.05, 2.05, 0.1), 0.2)
    _, static = network.window(1.05, 2.05, 1.05, 2.05)
    _, passed = network.window(3.05, 2.05, 3.05, 2.05)
    assert static[0, 0] > 0.7
    assert passed[0, 0] < 0.3


@settings(max_examples=40, deadline=None)
@given(
    step=st.floats(1e-3, 1e3),
    decay=st.floats(0.01, 50.0),
    share=st.floats(0.0, 0.99),
    looks=st.integers(1, 8),
)
def test_activity_stays_in_0_1(step: float, decay: float, share: float, looks: int) -> None:
    network = Network(ShuntingConfig(cell_m=0.1, decay_per_s=decay, lateral_sum=share * decay))
    for _ in range(looks):
        look(network, point(1.02, 2.07, 0.1), step)
    x, y = network.window(0.0, 1.0, 2.0, 3.0)
    assert x.min() >= 0.0
    assert x.max() < 1.0
    assert y.min() >= 0.0
    assert y.max() <= 1.0


def test_repeated_inspiration_keeps_a_bell_shape() -> None:
    network = Network(ShuntingConfig.paper(cell_m=0.1))
    rng = np.random.default_rng(3)
    for _ in range(30):
        look(network, point(1.05 + rng.normal(0.0, 0.01), 2.05, 0.1), 0.2)
    x, _ = network.window(0.65, 2.05, 1.45, 2.05)
    row = x[0]
    assert int(row.argmax()) == 4
    assert (np.diff(row[:5]) >= 0.0).all()
    assert (np.diff(row[4:]) <= 0.0).all()


def test_lateral_weights_are_symmetric_and_sum_to_W() -> None:
    config = ShuntingConfig.paper(cell_m=0.1)
    mu = lateral_mu(config.lateral_sum, config.lateral_reach_cells)
    assert mu == pytest.approx(0.0278, abs=1e-3)
    total = sum(
        mu / math.hypot(i, j)
        for i in range(-2, 3)
        for j in range(-2, 3)
        if 0.0 < math.hypot(i, j) < config.lateral_reach_cells
    )
    assert total == pytest.approx(config.lateral_sum)
    network = Network(config)
    for _ in range(20):
        look(network, point(0.05, 0.05, 0.1), 0.2)
    x, _ = network.window(-0.25, -0.25, 0.35, 0.35)
    np.testing.assert_allclose(x, x[::-1], rtol=0.05, atol=2e-3)  # sweeps run one way
    np.testing.assert_allclose(x, x.T, rtol=0.05, atol=2e-3)


def test_directory_and_pool_grow_without_losing_anything() -> None:
    network = Network(ShuntingConfig(cell_m=0.1))
    places = [(x * 7.0 + 0.05, y * 9.0 + 0.05) for x in range(-20, 20) for y in range(-12, 12)]
    for x, y in places:
        look(network, point(x, y, 0.1), 1.0)
    found = [activity(network, x, y) for x, y in places]
    assert min(found) == pytest.approx(max(found))
    assert min(found) > 0.3


def test_view_hides_what_is_behind_and_what_no_beam_passed() -> None:
    bearings = np.radians(np.arange(-90.0, 91.0))
    view = view_of_beams(bearings, np.full(181, 3.0), math.radians(1.0), 0.1)
    network = Network(ShuntingConfig(cell_m=0.1))
    seen, behind, back = (2.05, 0.05), (4.05, 0.05), (-2.05, 0.05)
    for place in (seen, behind, back):
        look(network, point(*place, 0.1), 1.0)
    before = [activity(network, *place) for place in (seen, behind, back)]
    network.integrate(view, ORIGIN, 1.0, write=True)
    after = [activity(network, *place) for place in (seen, behind, back)]
    assert after[0] < before[0]
    assert after[1:] == before[1:]


def test_view_of_features_sees_between_them_and_not_past_the_gap() -> None:
    view = view_of_features(se2.transform(ORIGIN, np.array([[5.0, 2.0], [5.0, -2.0]])), 0.1)
    limit = view.limit
    assert limit[0] == pytest.approx(math.hypot(5.0, 2.0))  # straight ahead
    assert limit[len(limit) // 2] == 0.0  # behind


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"lateral_sum": 0.8}, "lateral_sum"),
        ({"cell_m": 0.0}, "cell_m"),
        ({"decay_per_s": math.nan}, "decay_per_s"),
        ({"objective": "max"}, "objective"),
        ({"trace_s": 0.0, "short_term_weight": 0.0}, "short_term_weight"),
    ],
)
def test_config_names_what_is_wrong(change: dict[str, object], named: str) -> None:
    with pytest.raises(InvalidValueError, match=named):
        ShuntingConfig(**change)  # type: ignore[arg-type]


def test_a_map_too_wide_for_its_cells_is_refused() -> None:
    network = Network(ShuntingConfig(cell_m=0.01))
    with pytest.raises(InvalidValueError, match="across"):
        look(network, point(1e6, 0.0, 0.01), 1.0)
