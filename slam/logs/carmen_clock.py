# SPDX-License-Identifier: Apache-2.0
"""The times of a CARMEN log: one clock for all its messages, and how long things took."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

from slam import se2
from slam.logs.carmen_messages import LaserMessage, Pose, PoseMessage
from slam.logs.repairs import STAMPS_SPREAD, Repairs
from slam.logs.stamps import continued, put_in_order, unwrapped

ODOM_S = 0.16  # between two ODOM lines, as in the public logs of a B21 (Intel, FHW, CSAIL)
SPEED, TURN = 0.5, 0.5  # m/s, rad/s: of an indoor robot that moves, where nothing else is known
LEAST_S = 0.1  # between scans that were kept although the robot stood
MESSAGE_S = 0.05  # between any two lines of a log of scans at the full rate
T = TypeVar("T", LaserMessage, PoseMessage)
Message = LaserMessage | PoseMessage


class Clock:
    """New stamps for messages by their lines.

    Steps back of 1 s or more show best in the sequence of all messages: scans that a mapper kept
    lie seconds apart.
    """

    def __init__(
        self,
        scans: Sequence[LaserMessage],
        tracks: Sequence[Sequence[PoseMessage]],
        repairs: Repairs,
        digits: int,
    ) -> None:
        """``tracks``: the other messages; ``digits`` that the stamps were printed with."""
        both: list[Message] = [*scans, *(m for track in tracks for m in track)]
        both.sort(key=lambda m: m.line)
        kept = both[:1] + [m for before, m in pairwise(both) if not _echo(before, m)]
        lines = [m.line for m in kept]
        stamps = unwrapped([m.stamp_ns for m in kept], lines, repairs)
        stamps = continued(stamps, lines, repairs, digits)
        equal = sum(a.stamp_ns == b.stamp_ns for a, b in pairwise(scans))
        if equal and scans[0].robot_pose is None:  # odometry is interpolated to the scans' times
            steps = [MESSAGE_S] * (len(kept) - 1)
            ordered = put_in_order(repairs.path, stamps, lines, steps_s=steps, digits=digits)
            repairs.note(STAMPS_SPREAD, f"{equal} scans have the time of another", None, equal)
            kept = [kept[k] for k in ordered.order]
            stamps = ordered.stamps_ns
        self._changed = {
            m.line: now for m, now in zip(kept, stamps, strict=True) if m.stamp_ns != now
        }

    def __call__(self, messages: list[T]) -> list[T]:
        """The messages with their new stamps."""
        if not self._changed:
            return messages
        return [replace(m, stamp_ns=self._changed.get(m.line, m.stamp_ns)) for m in messages]


def _echo(before: Message, message: Message) -> bool:
    """A mapper's corrected pose once more, right after its scan: its time is none of a clock."""
    return (
        isinstance(before, LaserMessage)
        and isinstance(message, PoseMessage)
        and message.pose == before.robot_pose
    )


def rough_steps(scans: Sequence[LaserMessage], odom: Sequence[PoseMessage]) -> list[float] | None:
    """About how long each scan was before the next, s; None where nothing says.

    Wheels report at a steady rate, so ODOM lines count time. Without them, the way and the turn
    between two scans do.
    """
    lines = [message.line for message in odom]
    if len(lines) >= len(scans):
        at = [bisect.bisect(lines, scan.line) for scan in scans]
        return [max((b - a) * ODOM_S, LEAST_S) for a, b in pairwise(at)]
    poses = [scan.robot_pose for scan in scans]
    known: list[Pose] = [pose for pose in poses if pose is not None]
    if len(known) < len(poses):
        return None
    return steps_of_way(known)


def steps_of_way(poses: Sequence[Sequence[float]]) -> list[float]:
    """About how long it took from each pose to the next, s."""
    return [
        max(
            math.hypot(b[0] - a[0], b[1] - a[1]) / SPEED,
            abs(se2.wrap(b[2] - a[2])) / TURN,
            LEAST_S,
        )
        for a, b in pairwise(poses)
    ]
