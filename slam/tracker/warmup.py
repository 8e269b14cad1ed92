# SPDX-License-Identifier: Apache-2.0
"""A little room in which a tracker's kernels run before the first frame, so that none waits.

Those of searches and loops too: a robot that is lost has no more time than another.

Compiled code is cached on disk: the seconds are spent once after an installation, or in every
process where no folder for the cache can be written.
"""

import numpy as np

from slam.frames import NS_PER_S, Frame, LaserSpec, Odometry, Scan
from slam.frontend.observations import observe
from slam.posegraph import Edge, optimise
from slam.tracker.cell_map import CellMap
from slam.tracker.matching.budget import Budget
from slam.tracker.matching.coarse_map import CoarseMap
from slam.tracker.matching.local_search import SearchWindow
from slam.tracker.matching.matcher import Matcher
from slam.tracker.matching.whole_search import WholeSearch
from slam.tracker.rasterise import rasterise, seen_at
from slam.tracker.uncertainty.covariances import carried, observable

COMPILE_S = 10.0  # of one core of a Xeon, measured
SPEC = LaserSpec(n_beams=9, angle_min=-1.0, angle_increment=0.25)
RANGES = np.array([2.0, 2.0, 2.0, 1.0, 3.0, 3.0, 2.0, 2.0, np.inf], np.float32)


def frame(k: int) -> Frame:
    """The room as a robot that rests sees it for the k-th time, 10 times a second."""
    stamp_ns, spread = k * NS_PER_S // 10, np.diag([0.1, 0.1, 0.1])
    return Frame(
        stamp_ns=stamp_ns,
        odometry=Odometry(stamp_ns=stamp_ns, T_odom_robot=np.zeros(3), increment_covariance=spread),
        scan=Scan(stamp_ns=stamp_ns, ranges=RANGES, spec=SPEC),
    )


def search(cell_map: CellMap, submap: CellMap, matcher: Matcher) -> None:
    """Run the kernels of searches and loops, which an ordinary scan does not need."""
    seen = observe(frame(0), np.zeros(3), matcher.config)
    window = SearchWindow(reach_m=0.2, turn_rad=0.1)
    matcher.search(cell_map, seen, np.zeros(3), np.eye(3), window)
    numbers, coarse = matcher.config.matching, CoarseMap(cell_map, 0.3)
    whole = WholeSearch(coarse, seen.points_robot, 1, numbers.whole)
    while not whole.done:
        whole.advance(Budget(numbers.budget, 1.0))
    seen_at(submap, seen, np.zeros(3))
    rasterise(submap, seen, np.zeros(3))
    submap.integrate(seen.view, np.zeros(3), 1.0, write=True)
    cell_map.window(0.0, 0.0, 1.0, 1.0)
    carried(np.eye(3), np.zeros(3), 0.0, 0.0, np.eye(3))
    observable(np.eye(3), 0.0, 2.0, np.eye(3))
    optimise(np.zeros((2, 3)), [Edge(a=0, b=1, T_a_b=np.zeros(3), information=np.eye(3))])
