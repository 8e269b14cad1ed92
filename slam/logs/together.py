# SPDX-License-Identifier: Apache-2.0
"""Several scanners of one robot as one stream: each frame has the scan of one of them."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from heapq import merge
from itertools import repeat

from slam.constant_velocity import standing
from slam.errors import InvalidValueError
from slam.frames import Frame, Odometry, Stream


def together(streams: Sequence[Stream]) -> Stream:
    """Streams of one recording, a scanner each, in the order of their stamps.

    It begins with a scan of the first, which is the scanner of who takes but one
    (``slam.one_scanner``); ``metadata.others`` has the rest. Of scans at one time, each comes 1 ns
    after the one before it. Raises ``InvalidValueError`` where one of several is not known to be
    mounted anywhere: their scans would contradict each other; and where two are the same scanner.
    """
    first, *others = (stream.metadata for stream in streams)
    if not others:
        return streams[0]
    for one in (first, *others):
        if not one.mounting:
            raise InvalidValueError(
                f"{one.extra.get('file')}: nothing says how the scanner of {one.extra.get('scan')} "
                "is mounted, and there are several: give --laser x,y,yaw_deg once for each --scan, "
                "in their order"
            )
    names = [one.extra["scan"] for one in (first, *others) if "scan" in one.extra]
    if twice := [name for k, name in enumerate(names) if name in names[:k]]:
        raise InvalidValueError(
            f"{first.extra.get('file')}: the scans of {twice[0]} are named twice"
        )
    measured = all(one.odometry for one in (first, *others))
    lengths = [stream.length for stream in streams]
    return Stream(
        metadata=replace(first, others=tuple(others), odometry=measured),
        frames=lambda: _merged(streams, measured),
        length=None if None in lengths else sum(length or 0 for length in lengths),
    )


def _merged(streams: Sequence[Stream], measured: bool) -> Iterator[Frame]:
    numbered = (zip(stream, repeat(k)) for k, stream in enumerate(streams))
    return _in_turn(merge(*numbered, key=lambda one: one[0].stamp_ns), measured)


def one_by_one(frames: Iterable[Sequence[Frame]]) -> Iterator[Frame]:
    """The same of frames of all scanners at one time, and those of the next."""
    numbered = ((frame, k) for several in frames for k, frame in enumerate(several))
    return _in_turn(numbered, measured=True)


def _in_turn(numbered: Iterable[tuple[Frame, int]], measured: bool) -> Iterator[Frame]:
    before: Frame | None = None
    own_ns: dict[int, int] = {}  # the stamp before, by stream
    for frame, k in numbered:
        since_ns, own_ns[k] = own_ns.get(k), frame.stamp_ns
        if before is None and k:
            continue
        before = frame if before is None else _after(before, frame, since_ns, measured)
        yield before


def _after(before: Frame, frame: Frame, since_ns: int | None, measured: bool) -> Frame:
    """The frame with a stamp and a covariance of odometry that follow those of ``before``.

    measured  whether there is odometry
    since_ns  the stamp that its covariance begins at, which grows with time
    """
    if measured and since_ns == before.stamp_ns:
        return frame
    stamp_ns, odometry, scan = max(frame.stamp_ns, before.stamp_ns + 1), frame.odometry, frame.scan
    if not measured:
        odometry = standing(stamp_ns, before.stamp_ns)
    else:
        spread = odometry.increment_covariance
        if spread is not None:
            whole_ns = stamp_ns - (before.stamp_ns if since_ns is None else since_ns)
            spread = spread * ((stamp_ns - before.stamp_ns) / max(whole_ns, 1))
        odometry = Odometry(
            stamp_ns=stamp_ns, T_odom_robot=odometry.T_odom_robot, increment_covariance=spread,
            twist=odometry.twist,
        )  # fmt: skip
    if scan is not None and scan.stamp_ns != stamp_ns:
        scan = replace(scan, stamp_ns=stamp_ns)
    features = frame.features
    if features is not None and features.stamp_ns != stamp_ns:
        features = replace(features, stamp_ns=stamp_ns)
    return replace(frame, stamp_ns=stamp_ns, odometry=odometry, scan=scan, features=features)
