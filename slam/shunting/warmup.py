# SPDX-License-Identifier: Apache-2.0
"""Get the kernels of an ordinary scan ready before the first frame, so that none waits for them.

Those of the wide search get ready when it is first wanted (``search``), which may be never.

Compiled code is cached on disk: the seconds are spent once after an installation, or in every
process where no folder for the cache can be written.
"""

from __future__ import annotations

import functools

import numpy as np

from slam.compiling import announced
from slam.frames import LaserSpec, Scan
from slam.frontend.observations import from_scan
from slam.shunting.config import ShuntingConfig
from slam.shunting.map.network import Network
from slam.shunting.map.rasterise import rasterise
from slam.shunting.matching.matcher import Matcher
from slam.shunting.uncertainty.covariances import advance, carried, innovation, observable
from slam.shunting.uncertainty.residuals import look


@functools.cache
def warm_up() -> None:
    """Run every kernel of an ordinary scan once on a little room, the first time in a process."""
    with announced("the SLAM's kernels"):
        _run_all()


def _run_all() -> None:
    config = ShuntingConfig(cell_m=0.2)
    spec = LaserSpec(n_beams=9, angle_min=-1.0, angle_increment=0.25)
    ranges = np.array([2.0, 2.0, 2.0, 1.0, 3.0, 3.0, 2.0, 2.0, np.inf], np.float32)
    network, matcher = Network(config), Matcher(config)
    origin, covariance = np.zeros(3), np.diag([0.1, 0.1, 0.1])
    seen = from_scan(Scan(stamp_ns=0, ranges=ranges, spec=spec), np.zeros(3), config)
    look(network, 0.3, seen, origin, 1.0, 0)
    whole = [np.eye(3) for _ in range(4)]
    advance(
        whole[0],
        whole[1],
        whole[2],
        whole[3],
        origin,
        covariance,
        covariance,
        (1.0, 1.0, 1.0, 1.0),
        0.0,
    )
    carried(covariance, origin, 0.0, 0.0, np.eye(3))
    observable(covariance, 0.0, 2.0, np.eye(3))
    innovation(covariance, covariance, covariance, origin, 1.0)
    for write in (False, True):
        rasterise(network, seen, origin)
        network.integrate(seen.view, origin, 1.0, write=write)
    start = matcher.approach(network, seen, origin, covariance)
    matcher.climb(network, seen, start, origin, np.linalg.inv(covariance))
    network.window(0.0, 0.0, 1.0, 1.0)
