# SPDX-License-Identifier: Apache-2.0
"""Ceiling tags: where the robot and everything else truly is, at any stamp.

A camera on the ceiling that reads a marker on each thing, without its errors: the truth a run is
scored against. Poses are noted at the physics steps and interpolated to a scan's stamp, which for
a 100 degree field of view lies inside a step.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float


class CeilingTags:
    """Remembers the last poses of the robot and of all movers.

    depth  how many steps back a stamp may lie; the longest scan has 16
    """

    def __init__(self, depth: int = 32) -> None:
        if depth < 2:
            raise InvalidValueError(f"CeilingTags.depth must be >= 2, got {depth}")
        self._seen: deque[tuple[int, Float, Float]] = deque(maxlen=depth)

    def note(self, time_ns: int, robot: ArrayLike, movers: ArrayLike | None = None) -> None:
        """Note the poses at ``time_ns``: robot (3,), movers (n, 3), each x m, y m, theta rad.

        Raises ``InvalidValueError`` for a time not after the last one.
        """
        if self._seen and time_ns <= self._seen[-1][0]:
            raise InvalidValueError(
                f"CeilingTags.note: time_ns must be after {self._seen[-1][0]}, got {time_ns}"
            )
        others = np.zeros((0, 3)) if movers is None else movers
        self._seen.append(
            (time_ns, np.array(robot, dtype=np.float64), np.array(others, dtype=np.float64))
        )

    def reset(self) -> None:
        """Forget everything, for a new run or a restored one."""
        self._seen.clear()

    def robot(self, stamp_ns: int) -> Float:
        """(3,) ``T_world_robot`` at the stamp, on the arc between the two nearest steps."""
        before, after, fraction = self._around(stamp_ns)
        if fraction == 0.0:
            return before[1].copy()
        return se2.interpolate(before[1], after[1], fraction)

    def movers(self, stamp_ns: int) -> Float:
        """(n, 3) poses of the movers at the stamp; straight between steps, nearer way round."""
        before, after, fraction = self._around(stamp_ns)
        if fraction == 0.0:
            return before[2].copy()
        change: NDArray[np.float64] = after[2] - before[2]
        change[:, 2] = se2.wrap_array(change[:, 2])
        out: Float = before[2] + fraction * change
        return out

    def _around(
        self, stamp_ns: int
    ) -> tuple[tuple[int, Float, Float], tuple[int, Float, Float], float]:
        seen = self._seen
        if not seen or not seen[0][0] <= stamp_ns <= seen[-1][0]:
            span = f"{seen[0][0]}..{seen[-1][0]}" if seen else "nothing"
            raise InvalidValueError(
                f"CeilingTags: stamp {stamp_ns} ns is outside what was noted ({span})"
            )
        for i in range(len(seen) - 1, -1, -1):
            if seen[i][0] == stamp_ns:
                return seen[i], seen[i], 0.0
            if seen[i][0] < stamp_ns:
                before, after = seen[i], seen[i + 1]
                return before, after, (stamp_ns - before[0]) / (after[0] - before[0])
        raise AssertionError("unreachable: the stamp lies within the span")
