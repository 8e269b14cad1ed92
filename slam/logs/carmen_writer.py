# SPDX-License-Identifier: Apache-2.0
"""Write a stream as a CARMEN log, for the many tools that read nothing else."""

from __future__ import annotations

import gzip
import lzma
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from slam import se2
from slam.errors import InvalidValueError
from slam.files import replacing
from slam.frames import NS_PER_S, Frame, Scan, Stream

_HOST = "mobilia"
_SICK_LMS = 1  # laser_type of CARMEN


def write_carmen(path: str | Path, stream: Stream) -> None:
    """ODOM, ROBOTLASER1 and, where there is truth, TRUEPOS per frame; .gz and .xz by suffix.

    ``read_carmen`` gives the same frames back, up to what the format has no word for: beam times,
    labels, odometry covariance and twist, the shortest range. No return (inf) is written as the
    scanner's maximum range and an error code (NaN) as 0, as CARMEN's drivers do.
    Raises ``InvalidValueError`` for a frame without a scan, ``OutputError`` when the file cannot be
    written; in both cases nothing is left behind.
    """
    path = Path(path)
    with replacing(path) as temporary:
        if path.suffix == ".gz":  # no time stamp and no file name: the same stream, the same bytes
            with temporary.open("wb") as raw, gzip.GzipFile("", "wb", 6, raw, mtime=0) as file:
                for line in _lines(stream):
                    file.write(line.encode("ascii"))
        elif path.suffix == ".xz":
            with lzma.open(temporary, "wb") as xz_file:
                for line in _lines(stream):
                    xz_file.write(line.encode("ascii"))
        else:
            with temporary.open("w", encoding="ascii", newline="\n") as text_file:
                text_file.writelines(_lines(stream))


def _lines(stream: Stream) -> Iterator[str]:
    yield "# CARMEN Logfile\n# file format is one message per line\n"
    yield "# message_name [message contents] ipc_timestamp ipc_hostname logger_timestamp\n"
    start_ns: int | None = None
    for number, frame in enumerate(stream):
        if frame.scan is None:
            raise InvalidValueError(f"frame {number} has no scan: CARMEN logs hold only scans")
        start_ns = frame.stamp_ns if start_ns is None else start_ns
        end = f"{_seconds(frame.stamp_ns)} {_HOST} {_seconds(frame.stamp_ns - start_ns)}\n"
        pose = _words(frame.odometry.T_odom_robot)
        yield f"ODOM {pose} 0 0 0 {end}"
        if frame.truth is not None:
            yield f"TRUEPOS {_words(frame.truth)} {pose} {end}"
        yield f"{_robotlaser(frame, frame.scan)} {end}"


def _robotlaser(frame: Frame, scan: Scan) -> str:
    spec = scan.spec
    fov = (spec.n_beams - 1) * spec.angle_increment
    ranges = np.where(np.isnan(scan.ranges), np.float32(0.0), scan.ranges)
    written = [str(r) if math.isfinite(r) else repr(spec.range_max) for r in ranges]
    intensities = () if scan.intensities is None else np.nan_to_num(scan.intensities)
    T_odom_robot = frame.odometry.T_odom_robot
    words = [
        f"ROBOTLASER1 {_SICK_LMS} {spec.angle_min!r} {fov!r} {spec.angle_increment!r}",
        f"{spec.range_max!r} 0.01 0",
        f"{spec.n_beams} {' '.join(written)}",
        " ".join([str(len(intensities)), *map(str, intensities)]),
        _words(se2.compose(T_odom_robot, spec.T_robot_laser)),
        _words(T_odom_robot),
        "0 0 0 0 0",
    ]
    return " ".join(words)


def _words(pose: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    return " ".join(map(repr, pose.tolist()))


def _seconds(stamp_ns: int) -> str:
    sign = "-" if stamp_ns < 0 else ""
    whole, nanoseconds = divmod(abs(stamp_ns), NS_PER_S)
    return f"{sign}{whole}.{nanoseconds:09d}"
