# SPDX-License-Identifier: Apache-2.0
"""A ROS message of which only the numbers change: serialised once, then filled in place.

Serialising field by field would cost more than simulating the scan. So the library serialises one
prototype whose variable numbers are marks; where a mark is found in its bytes, there the numbers
of every later message go. The layout stays the library's business.
"""

from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from slam.frames import NS_PER_S

_STAMP = (0x5EC0ACED, 0x3ABB0ACE)
# Time of a bag at second 0 of its simulation: 14 November 2023, 22:13:20 UTC. Readers of ROS take a
# stamp near 0 for "the latest" or for a clock that nobody has set. Round, so that people see the
# simulated second in a stamp; the same for every bag, so that bags stay the same bytes.
EPOCH_NS = 1_700_000_000 * NS_PER_S
UNIX_NS = 400_000_000 * NS_PER_S  # stamps of logs from here on (1982) are such times already
STORE = get_typestore(Stores.ROS2_HUMBLE)  # the types used here are the same in later ones


def message(kind: str, **given: Any) -> Any:
    """A message by type name and fields: ``message("geometry_msgs/msg/Point", x=1.0)``.

    Fields that are not given are 0, False, "" or empty. A part that is a message may be given as a
    mapping of its fields, or as an array of all its numbers in their order: x, y, z and quaternion.
    """
    parts = {name: _part(how, given.pop(name, None)) for name, how in STORE.fielddefs[kind][1]}
    return STORE.types[kind](**parts, **given)


def _part(how: Any, given: Any) -> Any:
    """One field; the library says ``how`` it is: its sort, and its type, or item and size."""
    sort, what = how
    if isinstance(given, np.ndarray) and sort == Nodetype.NAME:
        given = iter(given.tolist())
    if isinstance(given, Iterator):  # numbers in a row: some of them are its own
        if sort == Nodetype.NAME:
            return message(what, **{name: given for name, _ in STORE.fielddefs[what][1]})
        return next(given) if sort == Nodetype.BASE else np.array([*islice(given, what[1])])
    if sort == Nodetype.NAME:
        fields = {} if given is None else given
        return message(what, **fields) if isinstance(fields, Mapping) else fields
    if given is not None:
        return given
    if sort == Nodetype.BASE:
        return "" if what[0] == "string" else np.zeros((), what[0]).item()
    (item, name), size = what
    return np.zeros(size, name[0]) if item == Nodetype.BASE and name[0] != "string" else []


def header(frame_id: str) -> Any:
    """A std_msgs/Header with a stamp that ``Template.stamp`` finds."""
    return message("std_msgs/msg/Header", stamp=marked_time(), frame_id=frame_id)


def marked_time() -> Any:
    """A builtin_interfaces/Time that ``Template.stamp`` finds."""
    return message("builtin_interfaces/msg/Time", sec=_STAMP[0], nanosec=_STAMP[1])


def time_of(stamp_ns: int) -> Any:
    """The time of a frame as a bag says it, for the header of a topic of your own."""
    seconds, nanoseconds = divmod(said_ns(stamp_ns), NS_PER_S)
    return message("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)


def said_ns(stamp_ns: int) -> int:
    """What a message says for the stamp of a frame, ns: its seconds must fit 31 bits."""
    return stamp_ns if stamp_ns >= UNIX_NS else stamp_ns + EPOCH_NS


class Marks:
    """Unmistakable numbers, others at each call; floats that float32 holds exactly."""

    def __init__(self) -> None:
        self._rng = np.random.default_rng(0)

    def __call__(self, n: int, dtype: Any = np.float64) -> NDArray[Any]:
        """(n,) of them."""
        if np.issubdtype(dtype, np.floating):
            return (self._rng.integers(1 << 23, 1 << 24, n) / 4096.0).astype(dtype)
        return self._rng.integers(1, 255, n).astype(dtype)


class Template:
    """The bytes of ``prototype``, a message of type ``kind``, ready to be written in ``data``."""

    def __init__(self, kind: str, prototype: Any) -> None:
        self.kind = kind
        self.data = bytearray(STORE.serialize_cdr(prototype, kind))
        self.raw = np.frombuffer(self.data, dtype=np.uint8)
        self._stamps = [
            np.frombuffer(self.data, "<u4", 2, at)
            for at in self._places(np.array(_STAMP, dtype="<u4").tobytes())
        ]

    def _places(self, mark: bytes) -> list[int]:
        places, at = [], self.data.find(mark)
        while at >= 0:
            places.append(at)
            at = self.data.find(mark, at + 1)
        return places

    def view(self, mark: NDArray[Any]) -> NDArray[Any]:
        """A window onto the numbers that ``mark`` stands for; what is written there is sent."""
        (at,) = self._places(mark.tobytes())
        return np.frombuffer(self.data, mark.dtype, mark.size, at)

    def index(self, marks: NDArray[Any]) -> NDArray[np.int64]:
        """(n, bytes) places in ``raw`` of n marks that lie apart, the rows of ``marks`` (n, k)."""
        first = [place for row in marks for place in self._places(row.tobytes())]
        at = np.array(first, dtype=np.int64).reshape(len(marks), 1)
        return at + np.arange(marks.shape[1] * marks.itemsize)

    def stamp(self, stamp_ns: int) -> bytearray:
        """Set every stamp of the message; its bytes, valid until the next change.

        stamp_ns  of a frame; the message says ``said_ns``
        """
        seconds, nanoseconds = divmod(said_ns(stamp_ns), NS_PER_S)
        for view in self._stamps:
            view[0], view[1] = seconds, nanoseconds
        return self.data
