# SPDX-License-Identifier: Apache-2.0
"""Get every kernel ready before the first frame, so that no frame waits for a compiler.

Compiled code is cached on disk: the seconds are spent once after an installation, or in every
process where no folder for the cache can be written.
"""

from __future__ import annotations

import functools
import logging
from typing import Any

import numpy as np
from numba.core import event

from slam.frames import LaserSpec, Scan
from slam.shunting.config import ShuntingConfig
from slam.shunting.covariances import advance, innovation, observable
from slam.shunting.everywhere import places
from slam.shunting.impressions import from_scan, stamp
from slam.shunting.matching import Matcher
from slam.shunting.network import Network
from slam.shunting.residuals import look
from slam.shunting.search import SearchWindow

_log = logging.getLogger(__name__)
COMPILING = "numba:compile"


class _SayOnce(event.Listener):  # type: ignore[misc]  # numba has no types
    """Logs one line when a kernel is really compiled, none when it comes from the cache."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: Any) -> None:
        if not self.said:
            _log.info("compiling the SLAM's kernels, which takes some seconds the first time")
        self.said = True

    def on_end(self, event: Any) -> None:
        pass


@functools.cache
def warm_up() -> None:
    """Run every kernel once on a little room; does nothing the second time in a process."""
    listener = _SayOnce()
    event.register(COMPILING, listener)
    try:
        _run_all()
    finally:
        event.unregister(COMPILING, listener)


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
        whole[0], whole[1], whole[2], whole[3], origin, covariance, covariance, (1.0, 1.0, 1.0, 1.0)
    )
    observable(covariance, 0.0, np.eye(3))
    innovation(covariance, covariance, covariance, origin, 1.0)
    for write in (False, True):
        stamp(network, seen, origin)
        network.integrate(seen.view, origin, 1.0, write=write)
    start = matcher.approach(network, seen, origin, covariance)
    window = SearchWindow(reach_m=0.4, turn_rad=0.1)
    matcher.climb(network, seen, start, origin, np.linalg.inv(covariance))
    matcher.search(network, seen, origin, np.linalg.inv(covariance), window)
    places(network, 0.3, seen.points_robot, 2)
    network.window(0.0, 0.0, 1.0, 1.0)
