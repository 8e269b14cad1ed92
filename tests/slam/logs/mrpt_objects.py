# SPDX-License-Identifier: Apache-2.0
"""Objects of MRPT rawlogs in every version of their layouts, after MRPT's sources."""

import math
import struct
from collections.abc import Sequence

import numpy as np

EPOCH_100NS = 116_444_736_000_000_000


def made(name: str, version: int, members: bytes, *, old: bool = False) -> bytes:
    """``old``: as before MRPT 0.5.5, without an end."""
    if old:
        head = struct.pack("<I", len(name)) + name.encode() + struct.pack("<i", version)
        return head + members
    return bytes((0x80 | len(name),)) + name.encode() + bytes((version,)) + members + b"\x88"


def stamp(ns: int) -> bytes:
    return struct.pack("<Q", EPOCH_100NS + ns // 100)


def text(words: str) -> bytes:
    return struct.pack("<I", len(words)) + words.encode()


def matrix(values: np.ndarray, kind: str = "CMatrix", *, old: bool = False) -> bytes:
    form = "<f8" if kind == "CMatrixD" else "<f4"
    shape = struct.pack("<2I", *values.shape)
    return made(kind, 0, shape + values.astype(form).tobytes(), old=old)


def pose2d(pose: Sequence[float], version: int = 1, *, old: bool = False) -> bytes:
    return made(
        "CPose2D" if old else "mrpt::poses::CPose2D",
        version,
        struct.pack("<3d" if version else "<3f", *pose),
        old=old,
    )


def pose3d(pose: Sequence[float], version: int = 3, roll: float = 0.0, *, old: bool = False):
    """x, y, yaw, rolled about its own axis first."""
    x, y, yaw = pose
    c, s, cr, sr = math.cos(yaw), math.sin(yaw), math.cos(roll), math.sin(roll)
    rotation = np.array([[c, -s * cr, s * sr], [s, c * cr, -c * sr], [0.0, sr, cr]])
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = rotation, (x, y, 0.3)
    if version == 0:
        members = matrix(whole, old=old)
    elif version == 1:
        members = matrix(whole, "CMatrixD", old=old)
    elif version == 2:
        ch, sh, crh, srh = (f(a / 2) for a in (yaw, roll) for f in (math.cos, math.sin))
        members = struct.pack("<7d", x, y, 0.3, ch * crh, ch * srh, sh * srh, sh * crh)
    else:
        members = struct.pack("<12d", x, y, 0.3, *rotation.ravel())
    return made("CPose3D" if old else "mrpt::poses::CPose3D", version, members, old=old)


def scan(
    ns: int,
    ranges: Sequence[float],
    *,
    version: int = 7,
    mount: bytes | None = None,
    aperture: float = 2.0,
    counter_clockwise: bool = True,
    range_max: float = 30.0,
    valid: Sequence[bool] | None = None,
    label: str = "LASER",
    name: str = "mrpt::obs::CObservation2DRangeScan",
    old: bool = False,
) -> bytes:
    values = np.asarray(ranges, dtype="<f4")
    flags = values < range_max if valid is None else np.asarray(valid)
    parts = [
        struct.pack("<f?f", aperture, counter_clockwise, range_max),
        mount if mount is not None else pose3d((0.2, 0.0, 0.0), min(version, 3)),
    ]
    if version < 6:
        parts.append(matrix(np.zeros((6, 6)), old=old))
    parts += [struct.pack("<I", len(values)), values.tobytes()]
    if version >= 1:
        parts.append(flags.astype("u1").tobytes())
    if version >= 2:
        parts.append(struct.pack("<f", 0.01))
    if version >= 3:
        parts.append(stamp(ns))
    if version >= 4:
        parts.append(struct.pack("<f", 0.004))
    if version >= 5:
        parts += [text(label), struct.pack("<d", 0.0)]
    if version >= 7:
        parts += [b"\x01", np.arange(len(values), dtype="<i4").tobytes()]
    return made(name, version, b"".join(parts), old=old)


def odometry(ns: int, pose: Sequence[float], version: int = 2) -> bytes:
    parts = [pose2d(pose, min(version, 1)), text("ODOMETRY"), stamp(ns)]
    if version == 1:
        parts.append(struct.pack("<?2i?2f", False, 0, 0, False, 0.0, 0.0))
    elif version == 2:
        parts.append(struct.pack("<?2i?3d", True, 3, 4, True, 0.1, 0.0, 0.2))
    return made("mrpt::obs::CObservationOdometry", version, b"".join(parts))


def movement(step: Sequence[float], ns: int, *, version: int = 7, matched: bool = False) -> bytes:
    """``matched``: by a scan matcher, as a Gaussian."""
    gaussian = made(
        "mrpt::poses::CPosePDFGaussian", 2, pose2d(step) + matrix(np.eye(3), "CMatrixD")
    )
    if version < 2:
        parts = [gaussian, struct.pack("<i", 0)]
    else:
        parts = [struct.pack("<i", int(matched)), gaussian if matched else pose2d(step)]
        if not matched:
            parts.append(struct.pack("<I6fI6f", 0, *[0.1] * 6, 100, *[0.1] * 6))
    parts.append(struct.pack("<??", False, False) + stamp(ns))
    moved = made("mrpt::obs::CActionRobotMovement2D", version, b"".join(parts))
    return made("mrpt::obs::CActionCollection", 0, struct.pack("<I", 1) + moved)


def frame(*observations: bytes, version: int = 2) -> bytes:
    head = b"\0" * {0: 12, 1: 4}.get(version, 0) + struct.pack("<I", len(observations))
    return made("mrpt::obs::CSensoryFrame", version, head + b"".join(observations))


def image(ns: int) -> bytes:
    """Something else, with bytes that look like ends of objects in it."""
    members = pose3d((0, 0, 0)) + b"\x88\x84CObs\x88" * 40 + stamp(ns)
    return made("mrpt::obs::CObservationImage", 4, members)
