# SPDX-License-Identifier: Apache-2.0
"""The objects of an MRPT rawlog, as MRPT's serialisation writes them, little endian.

Each is the length of its class name with the top bit set, the name, a version of the layout (one
byte), the members, and the byte 0x88. Files from before MRPT 0.5.5 have the length and three zero
bytes, the name, the version in four bytes, and no end. No length of the members is written: classes
that are not read here are passed over by looking for the next name of an observation.

Layouts after MRPT's sources: ``CObservation2DRangeScan`` (0 to 7), ``CObservationOdometry``
(0 to 2), ``CActionRobotMovement2D`` (0 to 7), ``CPose2D`` (0, 1), ``CPose3D`` (0 to 3).
"""

import math
import re
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.frames import Float

EPOCH_100NS = 116_444_736_000_000_000  # MRPT's time is 100 ns since 1601: here 1970-01-01
MAX_BEAMS = 20_000
MAX_LABEL_BYTES = 256
MAX_MATRIX = 16  # rows and columns
_END = 0x88
_NAME = re.compile(rb"(?:mrpt::\w{1,20}::)?(C\w{1,60})")
_NEXT = re.compile(
    rb"\x88+([\x80-\xff])((?:mrpt::\w{1,20}::)?"
    rb"C(?:Observation\w{1,60}|SensoryFrame|ActionCollection|Action\w{1,60}|Rawlog))"
)
_CONTAINERS = ("CSensoryFrame", "CActionCollection", "CRawlog")


class Torn(ValueError):
    """The bytes end inside an object."""


@dataclass(frozen=True, eq=False)
class ScanObject:
    """``CObservation2DRangeScan``: rad, m; ``pose`` (3, 4) of the scanner on the robot."""

    number: int
    label: str
    stamp_ns: int
    aperture: float
    counter_clockwise: bool
    range_max: float
    ranges: NDArray[np.float32]
    valid: NDArray[np.bool_]
    pose: Float


@dataclass(frozen=True, eq=False)
class OdometryObject:
    """``CObservationOdometry``: where the robot is by its wheels, m, m, rad."""

    number: int
    stamp_ns: int
    pose: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class MoveObject:
    """``CActionRobotMovement2D``: motion since the action before, in the robot's frame there."""

    number: int
    step: tuple[float, float, float]


Object = ScanObject | OdometryObject | MoveObject


class Objects:
    """Iterates over what is read here; ``skipped`` counts the others by class."""

    def __init__(self, data: bytes) -> None:
        self._data, self.at = data, 0
        self.skipped: Counter[str] = Counter()
        self.number = 0  # of the object at hand, from 1

    def __iter__(self) -> Iterator[Object]:
        """Raises ``ValueError`` for what no rawlog can hold, ``Torn`` where the bytes end early."""
        while self._more():
            self.number += 1
            name, version, old = self._header()
            if name in _CONTAINERS:
                self._enter(name, version)
                continue
            if name == "CObservation2DRangeScan":
                yield self._scan(version)
            elif name == "CObservationOdometry":
                yield self._odometry(version)
                self._pass_over(old)
            elif name == "CActionRobotMovement2D":
                step = self._movement(version)
                self._pass_over(old)
                if step is None:
                    self.skipped[name] += 1
                else:
                    yield MoveObject(self.number, step)
            else:
                self.skipped[name] += 1
                self._pass_over(old)

    # -- bytes ----------------------------------------------------------------------------

    def _more(self) -> bool:
        """Go past the ends of objects; whether anything is left."""
        while self.at < len(self._data) and self._data[self.at] == _END:
            self.at += 1
        return self.at < len(self._data)

    def _take(self, count: int) -> bytes:
        end = self.at + count
        if end > len(self._data):
            raise Torn(
                f"object {self.number} ends after {len(self._data) - self.at} of {count} bytes"
            )
        out = self._data[self.at : end]
        self.at = end
        return out

    def _numbers(self, form: str) -> tuple[Any, ...]:
        return struct.unpack("<" + form, self._take(struct.calcsize("<" + form)))

    def _header(self) -> tuple[str, int, bool]:
        """(class name without namespaces, version, whether of before MRPT 0.5.5)."""
        (first,) = self._numbers("B")
        old = not first & 0x80
        if old and self._take(3) != b"\0\0\0":
            raise ValueError(f"expected the name of a class at byte {self.at - 4}, got no length")
        raw = self._take(first & 0x7F)
        found = _NAME.fullmatch(raw)
        if found is None:
            raise ValueError(f"expected the name of a class, got {raw[:40]!r}")
        (version,) = self._numbers("i" if old else "B")
        return found[1].decode("ascii"), version, old

    def _end(self, old: bool) -> None:
        if not old and self._take(1)[0] != _END:
            raise ValueError(f"object {self.number} is longer than its version says")

    def _pass_over(self, old: bool) -> None:
        """To the next observation or action."""
        if old:
            raise ValueError("holds objects that only newer files name an end of; save it again "
                             "with MRPT")  # fmt: skip
        at = max(self.at - 1, 0)
        while (found := _NEXT.search(self._data, at)) is not None:
            if found[1][0] & 0x7F == len(found[2]):
                self.at = found.start(1)
                return
            at = found.start(1)
        self.at = len(self._data)

    def _finite(self, values: tuple[float, ...]) -> tuple[float, ...]:
        if not all(map(math.isfinite, values)):
            raise ValueError(f"object {self.number}: a pose must be finite, got {list(values)}")
        return values

    # -- objects --------------------------------------------------------------------------

    def _enter(self, name: str, version: int) -> None:
        """Into what holds other objects: they follow."""
        if name == "CSensoryFrame":
            self._take({0: 12, 1: 4}.get(version, 0))
        self._take(4)  # how many

    def _pose2d(self) -> tuple[float, float, float]:
        name, version, old = self._header()
        if name != "CPose2D" or version not in (0, 1):
            raise ValueError(f"expected a CPose2D of version 0 or 1, got {name} of {version}")
        x, y, theta = self._finite(self._numbers("3d" if version else "3f"))
        self._end(old)
        return x, y, theta

    def _matrix(self) -> Float:
        name, _, old = self._header()
        if name not in ("CMatrix", "CMatrixF", "CMatrixD"):
            raise ValueError(f"expected a matrix, got {name}")
        rows, columns = self._numbers("2I")
        if rows > MAX_MATRIX or columns > MAX_MATRIX:
            raise ValueError(f"expected a matrix of up to {MAX_MATRIX} rows, got {rows}x{columns}")
        form = "d" if name == "CMatrixD" else "f"
        values = self._numbers(f"{rows * columns}{form}")
        self._end(old)
        return np.array(values, dtype=np.float64).reshape(rows, columns)

    def _pose3d(self) -> Float:
        """(3, 4) rotation and position."""
        name, version, old = self._header()
        if name != "CPose3D" or not 0 <= version <= 3:
            raise ValueError(f"expected a CPose3D of version 0 to 3, got {name} of {version}")
        if version < 2:
            pose = self._matrix()
            if pose.shape != (4, 4):
                raise ValueError(f"expected a pose of 4x4, got {pose.shape}")
            pose = pose[:3]
        elif version == 2:
            pose = _of_quaternion(self._finite(self._numbers("7d")))
        else:
            values = np.array(self._finite(self._numbers("12d")))
            pose = np.hstack([values[3:].reshape(3, 3), values[:3, None]])
        self._finite(tuple(pose.ravel().tolist()))
        self._end(old)
        return pose

    def _label(self) -> str:
        (length,) = self._numbers("I")
        if length > MAX_LABEL_BYTES:
            raise ValueError(f"object {self.number} has a label of {length} bytes")
        return self._take(length).decode("utf-8", "replace")

    def _scan(self, version: int) -> ScanObject:
        if not 0 <= version <= 7:
            raise ValueError(f"CObservation2DRangeScan of version {version}; 0 to 7 are known")
        aperture, direction, range_max = self._numbers("fBf")
        pose = self._pose3d()
        if version < 6:
            self._matrix()  # covariance of the pose
        (n,) = self._numbers("I")
        if not 1 <= n <= MAX_BEAMS:
            raise ValueError(f"expected 1 to {MAX_BEAMS} beams, got {n}")
        ranges = np.frombuffer(self._take(4 * n), "<f4")
        valid = ranges < range_max if version == 0 else np.frombuffer(self._take(n), "u1") != 0
        self._take(4 if version >= 2 else 0)  # standard deviation
        (stamp,) = self._numbers("Q") if version >= 3 else (0,)
        self._take(4 if version >= 4 else 0)  # width of a beam
        label = ""
        if version >= 5:
            label = self._label()
            self._take(8)  # pitch during the sweep
        if version >= 7 and self._numbers("B")[0]:
            self._take(4 * n)  # intensities
        return ScanObject(
            number=self.number,
            label=label,
            stamp_ns=_unix_ns(stamp),
            aperture=aperture,
            counter_clockwise=bool(direction),
            range_max=range_max,
            ranges=ranges,
            valid=valid,
            pose=pose,
        )

    def _odometry(self, version: int) -> OdometryObject:
        if not 0 <= version <= 2:
            raise ValueError(f"CObservationOdometry of version {version}; 0 to 2 are known")
        pose = self._pose2d()
        self._label()
        (stamp,) = self._numbers("Q")
        return OdometryObject(self.number, _unix_ns(stamp), pose)

    def _movement(self, version: int) -> tuple[float, float, float] | None:
        """None where no pose of it can be told."""
        if not 0 <= version <= 7:
            raise ValueError(f"CActionRobotMovement2D of version {version}; 0 to 7 are known")
        if version >= 2:
            self._take(4)  # by odometry or by a scan matcher
        before = self.at
        name, _, _ = self._header()
        if name == "CPose2D":
            self.at = before
            return self._pose2d()
        return self._pose2d() if name == "CPosePDFGaussian" else None


def _unix_ns(stamp_100ns: int) -> int:
    """0 where there is none."""
    return (stamp_100ns - EPOCH_100NS) * 100 if stamp_100ns else 0


def _of_quaternion(values: tuple[float, ...]) -> Float:
    x, y, z, w, i, j, k = values
    return np.array([
        [1 - 2 * (j * j + k * k), 2 * (i * j - w * k), 2 * (i * k + w * j), x],
        [2 * (i * j + w * k), 1 - 2 * (i * i + k * k), 2 * (j * k - w * i), y],
        [2 * (i * k - w * j), 2 * (j * k + w * i), 1 - 2 * (i * i + j * j), z],
    ])  # fmt: skip
