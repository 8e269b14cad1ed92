# SPDX-License-Identifier: Apache-2.0
"""Get the kernels of an ordinary scan ready before the first frame, so that none waits for them.

Those of the searches too: a robot that is lost has no more time than another.

Compiled code is cached on disk: the seconds are spent once after an installation, or in every
process where no folder for the cache can be written.
"""

import functools
import gc
from collections.abc import Callable
from typing import Any

import numpy as np

from slam._jit import announced
from slam.frames import NS_PER_S, LaserSpec, Odometry, Scan
from slam.frontend.heading_bias import HeadingBias
from slam.frontend.motions import extended
from slam.frontend.observations import Observations, from_scan
from slam.frontend.odometry_prior import inverted, predict, squared, turned
from slam.posegraph import Edge, optimise
from slam.tracker.cell_map import CellMap
from slam.tracker.config import TrackerConfig
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Matcher
from slam.tracker.matching.whole_search import WholeSearch
from slam.tracker.rasterise import rasterise
from slam.tracker.standing.config import StandingConfig
from slam.tracker.standing.recent import Standing
from slam.tracker.uncertainty.covariances import carried, followed, observable
from slam.tracker.uncertainty.odometry_noise import innovation
from slam.tracker.uncertainty.residuals import look

COMPILE_S = 10.0  # of one core of a Xeon, measured


@functools.cache
def warm_up(config_class: type[TrackerConfig], *new_maps: Callable[[Any], CellMap]) -> None:
    """Run every kernel of an ordinary scan once on a little room, the first time in a process.

    ``new_maps`` make the map of a SLAM, and those of its loops, whose own kernels run as well.
    """
    with announced("the SLAM's kernels", COMPILE_S):
        config = config_class(cell_m=0.2)
        _run_all(config, *(new_map(config) for new_map in new_maps))
    gc.collect()
    gc.freeze()  # the compiler's objects stay: looking through them again takes 100 ms of a scan


def _run_all(config: TrackerConfig, cell_map: CellMap, *others: CellMap) -> None:
    spec = LaserSpec(n_beams=9, angle_min=-1.0, angle_increment=0.25)
    ranges = np.array([2.0, 2.0, 2.0, 1.0, 3.0, 3.0, 2.0, 2.0, np.inf], np.float32)
    matcher, origin, covariance = Matcher(config), np.zeros(3), np.diag([0.1, 0.1, 0.1])
    seen = from_scan(Scan(stamp_ns=0, ranges=ranges, spec=spec), np.zeros(3), config)
    look(cell_map, 0.3, seen, origin, (1.0, 0.0), 0)
    times = (1.0, 1.0, 1.0, 1.0)
    followed(
        np.eye(3), np.eye(3), np.eye(3), np.eye(3), origin, covariance, covariance,
        (1.0, 0.0, 1.0, 1.0, 1.0), times, times,
    )  # fmt: skip
    carried(covariance, origin, 0.0, 0.0, np.eye(3))
    observable(covariance, 0.0, 2.0, np.eye(3))
    still = [
        Odometry(stamp_ns=k, T_odom_robot=origin, increment_covariance=covariance) for k in (0, 1)
    ]
    prior = predict(origin, still[0], still[1]).covariance
    squared(origin, turned(prior, 0.1))
    HeadingBias().learn(origin, 1.0, (1.0, 1.0), (1.0, 0.0, prior))
    extended(np.zeros(3), np.eye(3), origin, prior)
    innovation(prior, prior, prior, origin, 1.0, (0.0, 0.0))
    for one in (cell_map, *others):
        for write in (False, True):
            rasterise(one, seen, origin)
            one.integrate(seen.view, origin, 1.0, write=write)
        one.release()
    standing = Standing(StandingConfig(thin_m=0.0))
    standing.add(0, origin, seen)
    standing.with_votes(NS_PER_S // 2, origin, covariance, seen)
    matcher.matched(cell_map, seen, origin, inverted(covariance))
    _search(cell_map, matcher, seen)
    cell_map.window(0.0, 0.0, 1.0, 1.0)
    optimise(np.zeros((2, 3)), [Edge(a=0, b=1, T_a_b=origin, information=np.eye(3))])


def _search(cell_map: CellMap, matcher: Matcher, seen: Observations) -> None:
    """Run the kernels of both searches."""
    window = SearchWindow(reach_m=0.2, turn_rad=0.1)
    matcher.search(cell_map, seen, np.zeros(3), np.eye(3), window)
    coarse = CoarseMap(cell_map, 0.3)
    search = WholeSearch(coarse, seen.points_robot, 1, matcher.config.matching.whole)
    while not search.done:
        search.advance(Budget(matcher.config.matching.budget, 1.0))
