# SPDX-License-Identifier: Apache-2.0
"""The search of the whole map: bounded work a scan, and the answers of a search in one go."""

import math
from itertools import combinations

import numpy as np
import pytest

from slam import se2
from slam.frontend.observations import Observations, from_scan
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.tracker.matching import coarse_map, whole_search
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.whole_search import WholeSearch
from tests.world2d import World2D, frames, laser, office, office_loop

CONFIG = ShuntingConfig(cell_m=0.05)
ROOM_M = 12.0
STREAM = frames(World2D(office()), office_loop(), rate_hz=2.0, spec=laser(181), seed=3)


@pytest.fixture(scope="module")
def slam() -> ShuntingSlam:
    system = ShuntingSlam(CONFIG)
    for frame in STREAM[:90]:
        system.update(frame.without_truth())
    return system


def seen_at(k: int) -> Observations:
    scan = STREAM[k].scan
    assert scan is not None
    return from_scan(scan, np.zeros(3), CONFIG)


def searched(
    slam: ShuntingSlam, k: int, share: float, about: tuple | None = None
) -> tuple[WholeSearch, list, list[float]]:
    """The search of one scan, its answers in order, and what each call spent."""
    coarse = CoarseMap(slam.cell_map, 0.3, ROOM_M if about else 0.0)
    search = WholeSearch(coarse, seen_at(k).points_robot, 6, CONFIG.matching.whole, about)
    found, spent = [], []
    while not search.done:
        budget = Budget(CONFIG.matching.budget, share)
        found += search.advance(budget)
        spent.append(budget.spent_ns)
    return search, found, spent


def test_the_first_answer_is_the_best_of_all_in_a_window(slam: ShuntingSlam) -> None:
    """And the answers are apart, and none is outside; windows reach beyond what was seen."""
    whole, rng = CONFIG.matching.whole, np.random.default_rng(5)
    for k in range(0, 90, 15):
        middle = np.append(rng.uniform(-ROOM_M + 2.0, ROOM_M - 2.0, 2), rng.uniform(-3.0, 3.0))
        search, found, _ = searched(slam, k, 1.0, (middle, 1.5, 0.3))
        coarse = search._coarse
        field = coarse.planes[0][0, 0].astype(np.int64)
        points, pitch = search._points, coarse.pitch
        reach = math.ceil(1.5 / pitch)
        offsets = np.arange(-reach, reach + 1)
        sums = []
        for turn in search._turns.tolist():
            c, s = math.cos(middle[2] + turn), math.sin(middle[2] + turn)
            rotated = np.stack(
                [c * points[:, 0] - s * points[:, 1], s * points[:, 0] + c * points[:, 1]], axis=1
            )
            columns, rows = (np.floor((rotated + middle[:2]) / pitch).astype(int)
                             - coarse.corner).T  # fmt: skip
            at = rows[:, None, None] + offsets[:, None], columns[:, None, None] + offsets
            sums.append(field[at].sum(axis=0))
        best = np.array(sums)
        if best.max() == 0:
            assert not found
            continue
        h, row, column = np.argwhere(best == best.max())[0]
        turn = float(search._turns[h])
        expected = middle + np.array([pitch * offsets[column], pitch * offsets[row], turn])
        np.testing.assert_array_equal(found[0], expected)
        for one, other in combinations(found, 2):
            far = math.hypot(*(one - other)[:2]) >= whole.apart_m - 1e-9
            assert far or abs(se2.wrap(float(one[2] - other[2]))) >= whole.apart_rad


@pytest.mark.parametrize("blocks", [1 << 20, 1])  # bounded by blocks of 8 x 8, or 64 x 64, cells
def test_over_many_scans_the_answers_are_those_of_one_search(slam, blocks, monkeypatch):
    monkeypatch.setattr(coarse_map, "MOST_BLOCKS", blocks)
    for k in range(0, 90, 15):
        _, at_once, _ = searched(slam, k, 100.0)
        for share in (1e-3, 0.03, 1.0):
            search, found, _ = searched(slam, k, share)
            np.testing.assert_array_equal(np.array(found), np.array(at_once))
            assert not search.advance(Budget(CONFIG.matching.budget, 1.0))  # given once


def test_no_scan_does_more_than_its_budget_and_one_item(slam: ShuntingSlam) -> None:
    """The largest items: a tile of the map, the candidates' places, some thousand blocks."""
    share = 0.01
    allowed = share * CONFIG.matching.budget.budget_ms * 1e6
    prices = CONFIG.matching.budget
    tile = prices.cell_ns * coarse_map.TILE[0] * coarse_map.TILE[1]
    headings = math.tau / CONFIG.matching.whole.finest_rad
    candidates = 2 * prices.place_ns * headings * CONFIG.matching.whole.points
    blocks = prices.order_ns * (100_000 + 2 * whole_search.SORTED * whole_search.BATCH)
    for k in (0, 30, 60):
        _, found, spent = searched(slam, k, share)
        assert found
        assert len(spent) > 5
        assert max(spent) <= allowed + max(tile, candidates, blocks)


def test_an_empty_map_and_an_empty_scan_have_no_answer(slam: ShuntingSlam) -> None:
    empty = CoarseMap(ShuntingSlam(CONFIG).cell_map, 0.3)
    assert WholeSearch(empty, seen_at(0).points_robot, 6, CONFIG.matching.whole).done
    whole = CoarseMap(slam.cell_map, 0.3)
    assert WholeSearch(whole, np.zeros((0, 2)), 6, CONFIG.matching.whole).done
