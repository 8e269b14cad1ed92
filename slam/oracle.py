# SPDX-License-Identifier: Apache-2.0
"""The oracle: any SLAM on the same scans with the returns from movers taken out by the true labels.

It tells a room that is unfair from one that is hard: where the oracle fails too, what stands still
does not tell where the robot is. It is a bound, no contestant: nobody else is shown labels.

``create("oracle(shunting)")`` takes out what can move, ``create("oracle(shunting,moving)")`` what
moves now (``slam.variants.oracle_of``).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slam.errors import NeedsLabelsError
from slam.estimate import Estimate, Raster
from slam.frames import BeamClass, Frame, Scan
from slam.interface import SlamSystem
from slam.shaped import one_of
from slam.trajectory import Trajectory
from slam.variants import ORACLE, TAKEN_OUT

KINDS = {
    "movable": (BeamClass.SEMI_STATIC, BeamClass.MOVING),
    "moving": (BeamClass.MOVING,),
}
OPTIONAL = (
    # the optional protocols of ``slam.interface``
    "landmarks", "changes", "save", "cells_hold", "poses_in_map",
    "estimates_at_end",  # of a program over files
    "processor_s", "memory_growth_bytes",  # of a system in a process of its own
)  # fmt: skip


class Oracle:
    """``slam`` behind the protocol; a frame without labels raises ``NeedsLabelsError``.

    takes_out  "movable": returns from whatever can move, resting or not; "moving": from what moves
               now. They become "no measurement" (NaN, intensity 0): not "no return", by which a
               beam says that nothing was there

    What ``slam`` can do beyond the protocol, this can. Raises ``InvalidValueError`` for any other
    ``takes_out``.
    """

    def __init__(self, slam: SlamSystem, takes_out: str = TAKEN_OUT[0]) -> None:
        self.slam, self.takes_out = slam, one_of("Oracle.takes_out", takes_out, KINDS)
        for name in OPTIONAL:
            if hasattr(slam, name):
                setattr(self, name, getattr(slam, name))

    def reset(self) -> None:
        """As the SLAM's."""
        self.slam.reset()

    def update(self, frame: Frame) -> Estimate:
        """The SLAM's, of the frame without those returns and without labels."""
        if frame.scan is None or frame.labels is None:
            raise NeedsLabelsError(
                f"{ORACLE}...) needs the true label of every beam, and the frame at "
                f"{frame.stamp_ns} ns has none. Simulations have them: --scene, or a bag of "
                "'mobilia generate'; in Python Simulation(..., labels=True). Logs of real robots "
                "have none."
            )
        blind = frame.without_truth()
        scan = without(frame.scan, frame.labels.kind, self.takes_out)
        return self.slam.update(blind if scan is frame.scan else replace(blind, scan=scan))

    def map(self) -> Raster | None:
        """As the SLAM's."""
        return self.slam.map()

    def trajectory(self) -> Trajectory:
        """As the SLAM's."""
        return self.slam.trajectory()


def without(scan: Scan, kind: NDArray[np.uint8], takes_out: str) -> Scan:
    """The scan with "no measurement" on the beams of those kinds; itself where there are none.

    kind       (n_beams,) ``BeamClass`` of each beam
    takes_out  a key of ``KINDS``
    """
    out = np.isin(kind, KINDS[takes_out])
    if not out.any():
        return scan
    ranges = np.where(out, np.float32(np.nan), scan.ranges)
    strength = scan.intensities
    return Scan(
        stamp_ns=scan.stamp_ns,
        ranges=ranges,
        spec=scan.spec,
        intensities=None if strength is None else np.where(out, np.float32(0.0), strength),
    )


def shown(system: SlamSystem, frame: Frame) -> Frame:
    """The frame as ``system`` may see it: without truth, and with labels for an ``Oracle`` only."""
    blind = frame.without_truth()
    return replace(blind, labels=frame.labels) if type(system) is Oracle else blind
