# SPDX-License-Identifier: Apache-2.0
"""A bag read once before its frames: which scans count, when they were, what is wrong with them."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.errors import LogFormatError
from slam.frames import to_s
from slam.logs.bag_head import messages_of
from slam.logs.bag_laser import shape_of, stamp_of
from slam.logs.bag_topics import Bag, Topics
from slam.logs.repairs import (
    AT_RANGE_MAX,
    LEFT_OUT,
    MAX_STEP_BACK_NS,
    SHORT_SCANS,
    STAMPS_SORTED,
    STAMPS_SPREAD,
    STANDS_STILL,
    Repairs,
    continued,
)
from slam.logs.standing import Standing
from slam.logs.text import about

SHORT = 0.5  # of the usual number of beams and of the usual field of view; less: a torn scan
NEARLY_MAX = 0.95  # of range_max, from where returns are none that say "nothing"
MASS = 0.005  # share of all beams exactly at range_max: one beam a scan is its farthest wall
Message = tuple[str, int, Any]


@dataclass(kw_only=True)
class Survey:
    """What one reading of a bag says of the next.

    stamps_ns   topic -> of each of its messages, on one clock
    ranks       number of a scan message -> its place by time; those that are left out are missing
    saturates   a range of range_max says "no return"
    stands      the odometry stands still while scans move
    varies      how the scanner's geometry varies from scan to scan, in words; "" where it does not
    """

    stamps_ns: dict[str, list[int]]
    ranks: dict[int, int] = field(default_factory=dict)
    saturates: bool = False
    stands: bool = False
    varies: str = ""

    def in_order(
        self, messages: Iterator[Message], scan: str
    ) -> Iterator[tuple[str, int, Any, int | None]]:
        """(topic, log time, message, stamp or None for its own), scans by their time."""
        count: defaultdict[str, int] = defaultdict(int)
        waiting: dict[int, tuple[str, int, Any, int | None]] = {}
        following = 0
        for topic, log_ns, message in messages:
            number = count[topic]
            count[topic] += 1
            stamps = self.stamps_ns.get(topic)
            stamp_ns = None if stamps is None else stamps[number]
            if topic != scan:
                yield topic, log_ns, message, stamp_ns
            elif number in self.ranks:
                waiting[self.ranks[number]] = topic, log_ns, message, stamp_ns
                while following in waiting:
                    yield waiting.pop(following)
                    following += 1


def survey(bag: Bag, topics: Topics, repairs: Repairs) -> Survey:
    """Read it once; what has to be put right is noted in ``repairs``.

    Raises ``LogFormatError`` for strict ones, and where no scan lies within the time of the
    odometry.
    """
    clocks: dict[str, list[tuple[int, int]]] = {
        name: [] for name in (topics.scan, topics.odometry, topics.truth) if name is not None
    }
    shapes: list[tuple[int, float, float, float]] = []
    full, standing = _Full(), Standing()
    for topic, log_ns, message in messages_of(bag, topics, clocks):
        with about(bag.path, bag.at):
            clocks[topic].append((stamp_of(message, log_ns), log_ns))
            if topic == topics.scan:
                shapes.append(shape_of(message))
                full.take(message)
                standing.scan(message.ranges)
            elif topic == topics.odometry:
                pose = message.pose.pose
                p, q = pose.position, pose.orientation
                standing.pose((p.x, p.y, 2.0 * math.atan2(q.z, q.w)))
    raw = {name: _stamps(name, clock, repairs) for name, clock in clocks.items()}
    found = Survey(stamps_ns={})
    for name, clock in clocks.items():
        repairs.where = f"topic {name}: "
        elapsed = [0, *(b - a for (_, a), (_, b) in pairwise(clock))]
        lines = [None] * len(clock)
        found.stamps_ns[name] = continued(raw[name], lines, repairs, elapsed_ns=elapsed)
    repairs.where = ""
    _as_odometry_stepped(found.stamps_ns, raw, topics)
    whole = _whole(shapes)
    if len(whole) < len(shapes):
        why = f"topic {topics.scan}: {len(shapes) - len(whole)} scans without beams or short ones"
        repairs.note(SHORT_SCANS, why, None, len(shapes) - len(whole))
    _tell_others(bag, topics, len(shapes), repairs)
    found.varies = _spread([shapes[k] for k in whole])
    if topics.odometry is not None and standing.stands:
        found.stands = True
        why = f"topic {topics.odometry}: the odometry stands still while scans move"
        repairs.note(STANDS_STILL, why, None, len(clocks[topics.odometry]))
    if full.mass:
        found.saturates = True
        why = f"topic {topics.scan}: {full.at} ranges exactly at range_max, as of no return"
        repairs.note(AT_RANGE_MAX, why, None, full.at)
    odometry = None if found.stands else topics.odometry
    found.ranks = _ranked(bag, found.stamps_ns, whole, (topics.scan, odometry), repairs)
    return found


def _tell_others(bag: Bag, topics: Topics, own: int, repairs: Repairs) -> None:
    """Scans of another frame, where the choice of the scanner has not told them."""
    scan = topics.scan
    others = bag.topics[scan][1] - own
    if others > 0 and not any(name.startswith(f"{scan}:") for name in topics.passed):
        why = f"topic {scan}: {others} scans of another frame than {topics.frame}"
        repairs.note(LEFT_OUT, why, None, others)


class _Full:
    """Counts ranges of range_max, and those a little below."""

    def __init__(self) -> None:
        self.at = self._below = self._all = 0

    def take(self, message: Any) -> None:
        """The next scan."""
        ranges, most = message.ranges, message.range_max
        self._all += len(ranges)
        if len(ranges) and ranges.max() >= NEARLY_MAX * most > 0.0:
            at = int((ranges == most).sum())
            self.at += at
            self._below += int(((ranges >= NEARLY_MAX * most) & (ranges < most)).sum())

    @property
    def mass(self) -> bool:
        """Whether they are too many to be returns of walls."""
        return self.at > max(MASS * self._all, self._below)


def _stamps(topic: str, clock: list[tuple[int, int]], repairs: Repairs) -> list[int]:
    """The stamps of a topic; those that do not change are replaced by the times of the log."""
    stamps, logged = [stamp for stamp, _ in clock], [log_ns for _, log_ns in clock]
    if len(set(stamps)) >= len(stamps) / 2 or len(set(logged)) < len(stamps) / 2:
        return stamps
    repairs.note(STAMPS_SPREAD, f"topic {topic}: the stamps do not change", None, len(stamps))
    return logged


def _as_odometry_stepped(
    stamps_ns: dict[str, list[int]], raw: dict[str, list[int]], topics: Topics
) -> None:
    """Topics whose clock was set back with that of the odometry go on as the odometry goes on.

    Each has its own period, so that their clocks would end up apart by as much.
    """

    def offsets(name: str) -> NDArray[np.int64]:
        return np.array(stamps_ns[name], np.int64) - np.array(raw[name], np.int64)

    if topics.odometry is None:
        return
    wanted = np.unique(offsets(topics.odometry))
    for name in (topics.scan, topics.truth):
        if name is None or not len(wanted) or not (own := offsets(name)).any():
            continue
        nearest = wanted[np.abs(own[:, None] - wanted).argmin(axis=1)]
        shift = np.where(np.abs(nearest - own) < MAX_STEP_BACK_NS, nearest - own, 0)
        stamps_ns[name] = (np.array(stamps_ns[name], np.int64) + shift).tolist()


def _whole(shapes: Sequence[tuple[int, float, float, float]]) -> list[int]:
    """The numbers of those that have about as many beams, or as wide a view, as is usual; all
    where most have none."""
    table = np.array(shapes, np.float64).reshape(-1, 4)
    beams, views = table[:, 0], (table[:, 0] - 1.0) * np.abs(table[:, 2])
    usual = (beams > 0) & np.isfinite(views)
    if usual.sum() <= 0.5 * len(shapes):
        return list(range(len(shapes)))
    enough = (beams >= SHORT * np.median(beams[usual])) | (views >= SHORT * np.median(views[usual]))
    return [int(k) for k in np.flatnonzero(enough & (beams > 0))]


def _spread(shapes: Sequence[tuple[int, float, float, float]]) -> str:
    """``455 to 460 beams, step 0.782 to 0.791°``."""
    words = []
    columns = list(zip(*shapes, strict=True)) or [(0,)] * 4
    for (what, scale, unit), column in zip(
        (("", 1.0, " beams"), ("first angle ", 180.0 / math.pi, "°"),
         ("step ", 180.0 / math.pi, "°"), ("range_max ", 1.0, " m")), columns, strict=True,
    ):  # fmt: skip
        low, high = min(column), max(column)
        if low != high:
            words.append(f"{what}{low * scale:.6g} to {high * scale:.6g}{unit}")
    return ", ".join(words)


def _ranked(
    bag: Bag,
    stamps_ns: dict[str, list[int]],
    whole: list[int],
    names: tuple[str, str | None],
    repairs: Repairs,
) -> dict[int, int]:
    """Number of a scan message -> its place by time, of those within the time of the odometry."""
    scan, odometry = names
    stamps = stamps_ns[scan]
    first: dict[int, int] = {}
    for k in whole:
        first.setdefault(stamps[k], k)
    back = sum(b < a for a, b in pairwise(first))
    if back:
        why = f"topic {scan}: {back} stamps step back by less than 1 s"
        repairs.note(STAMPS_SORTED, why, None, back)
    if len(first) < len(whole):
        why = f"topic {scan}: {len(whole) - len(first)} scans with the time of another"
        repairs.note(LEFT_OUT, why, None, len(whole) - len(first))
    kept = sorted(first)
    if odometry is not None and stamps_ns[odometry] and kept:
        begin, end = min(stamps_ns[odometry]), max(stamps_ns[odometry])
        within = [stamp for stamp in kept if begin <= stamp <= end]
        ranges = (
            f"scans are of {to_s(kept[0]):.12g} to {to_s(kept[-1]):.12g} s, "
            f"odometry is of {to_s(begin):.12g} to {to_s(end):.12g} s"
        )
        if not within:
            raise LogFormatError(
                bag.path, f"no scan lies within the time of the odometry: {ranges}; where one has "
                "simulated time and the other that of the wall, record again (use_sim_time)"
            )  # fmt: skip
        if len(within) < len(kept):
            why = f"{len(kept) - len(within)} scans outside the time of the odometry: {ranges}"
            repairs.note(LEFT_OUT, why, None, len(kept) - len(within))
        kept = within
    return {first[stamp]: rank for rank, stamp in enumerate(kept)}
