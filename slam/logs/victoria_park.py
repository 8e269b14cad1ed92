# SPDX-License-Identifier: Apache-2.0
"""Victoria Park, Sydney (Guivant and Nebot 2001): tree trunks, controls and GPS of a pick-up truck.

Read from the dataset's MATLAB files:

    features_trees.mat      TLsr s, zt (range m, bearing rad from the right, diameter m) per scan,
                            time s, u (speed m/s of the left rear wheel, steering rad)
    aa3_gpsx.mat            timeGps ms, Lo_m, La_m

The robot frame is the laser's: on the front left bumper, x forward.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam import inputs, se2
from slam.errors import LogFormatError
from slam.frames import NS_PER_S, Features, Float, Frame, Odometry, Stream, StreamMetadata, to_ns
from slam.logs.text import MAX_COORDINATE, MAX_RANGE_M, MAX_STAMP_S, about
from slam.logs.unpacking import check_mat

AXLES_M, HALF_TRACK_M = 2.83, 0.76  # L, H
LASER_AHEAD_M, LASER_LEFT_M = 3.78, 0.50  # a + L (of the rear axle), b
SPEED_STD, STEERING_STD = 0.25, math.radians(1.5)  # m/s, rad; of the mean over one scan
RANGE_STD_M, BEARING_STD = 0.25, math.radians(1.0)  # of a trunk: its shape, a beam is 0.5 degrees
WHERE = "README.md names where to get the dataset"
TREES, GPS = "features_trees.mat", "aa3_gpsx.mat"
MOST_SPEED, MOST_STEERING = 100.0, 1.2  # m/s, rad: of a truck, whose wheels cannot stand across
Fields = tuple[tuple[str, float], ...]  # columns as errors name them, how far from 0 they may be
_TIME = ("time", MAX_STAMP_S)
_CONTROL = (_TIME, ("speed", MOST_SPEED), ("steering angle", MOST_STEERING))
_TRUNK = (("range", MAX_RANGE_M), ("bearing", 2.0 * math.tau), ("diameter", MAX_RANGE_M))
_FIX = (_TIME, ("x", MAX_COORDINATE), ("y", MAX_COORDINATE))
_MAT_MAGIC = b"MATLAB 5.0 MAT-file"


@dataclass(frozen=True, kw_only=True, eq=False)
class GpsTrack:
    """``points`` (n, 2) m east, north at ``stamps_ns`` (n,)."""

    stamps_ns: NDArray[np.int64]
    points: Float


@dataclass(frozen=True, kw_only=True, eq=False)
class _Drive:
    """Scans (s, and (n, 3) range, bearing, diameter each); controls (m, 3) s, m/s, rad."""

    scan_times: Float
    detections: list[Float]
    controls: Float


def is_victoria_park(path: Path) -> bool:
    """True for a folder with the trees, or a MATLAB file."""
    if path.is_dir():
        return (path / TREES).is_file()
    if path.suffix != ".mat" or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_MAT_MAGIC)) == _MAT_MAGIC


def read_victoria_park(path: str | Path) -> Stream:
    """The drive as frames of features: one per laser scan, trunks in the laser's frame.

    ``path`` is the folder of the dataset or the file of its trees. Odometry
    chains the vehicle model over the 40 Hz controls up to each scan. No truth: GPS, which gives no
    heading and has gaps of minutes, is for ``read_gps``; ``metadata.extra`` says if it is there.
    Raises ``LogFormatError`` where files are missing, damaged or out of order.
    """
    given = Path(path)
    main = given / TREES if given.is_dir() else given
    if not main.is_file():
        raise LogFormatError(given, f"no Victoria Park here (no {TREES}); {WHERE}")
    drive = _drive(main)
    _check(main, drive)
    extra: dict[str, Any] = {
        "file": main.name,
        "detections": sum(len(found) for found in drive.detections),
        "controls": len(drive.controls),
        "gps_file": GPS if main.with_name(GPS).is_file() else None,
    }
    metadata = StreamMetadata(source="victoria_park", robot="pick-up truck", extra=extra)
    return Stream(
        metadata=metadata, frames=lambda: _frames(main, drive), length=len(drive.scan_times)
    )


def read_gps(path: str | Path) -> GpsTrack:
    """The GPS fixes of the folder ``path``, or of its GPS file."""
    given = Path(path)
    file = given / GPS if given.is_dir() else given
    if not file.is_file():
        raise LogFormatError(given, f"no GPS here (no {GPS}); {WHERE}")
    values = _load(file)
    names = ("timeGps", "Lo_m", "La_m")
    with about(file, "times and places"):
        table = np.column_stack([_row(file, values, name) for name in names])
    table[:, 0] /= 1000.0
    _within(file, "fix", table, _FIX)
    stamps_ns = np.array([to_ns(t) for t in table[:, 0].tolist()], dtype=np.int64)
    return GpsTrack(stamps_ns=stamps_ns, points=table[:, 1:])


def _load(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat  # takes half a second that other logs need not pay

    inputs.note(path)
    try:
        check_mat(path)
        values: dict[str, Any] = loadmat(path)
    except LogFormatError:
        raise
    except OSError as error:
        raise LogFormatError(path, f"cannot be read: {error.strerror or error}") from error
    except Exception as error:
        raise LogFormatError(path, f"is no MATLAB 5 file, or damaged: {error}") from error
    return values


def _row(path: Path, values: dict[str, Any], name: str) -> Float:
    """A vector of numbers, whichever way it lies."""
    if name not in values:
        raise LogFormatError(path, f"has no variable '{name}'")
    try:
        return np.asarray(values[name], dtype=np.float64).ravel()
    except (TypeError, ValueError) as error:
        raise LogFormatError(path, f"'{name}' is not numeric: {error}") from error


def _drive(path: Path) -> _Drive:
    values = _load(path)
    times = _row(path, values, "TLsr")
    with about(path, "'u', speed and steering angle"):
        speed, steering = _row(path, values, "u").reshape(2, -1)
    control_times = _row(path, values, "time")
    if len(control_times) != len(speed):
        raise LogFormatError(path, "times, speeds and steering angles differ in number")
    cells = np.asarray(values.get("zt", []), dtype=object).ravel()
    return _Drive(
        scan_times=times,
        detections=_cells(path, cells, len(times)),
        controls=np.column_stack([control_times, speed, steering]),
    )


def _cells(path: Path, cells: NDArray[np.object_], n: int) -> list[Float]:
    if len(cells) != n:
        raise LogFormatError(path, f"{n} scan times but detections of {len(cells)} scans")
    out = []
    for k, cell in enumerate(cells):
        with about(path, f"scan {k}"):
            found = np.asarray(cell, dtype=np.float64)
        if found.size and (found.ndim != 2 or found.shape[0] != 3):
            raise LogFormatError(path, f"scan {k}: expected 3 x n numbers, got {found.shape}")
        out.append(found.reshape(3, -1).T)
    return out


def _within(path: Path, what: str, rows: Float, fields: Fields) -> None:
    """``LogFormatError`` for a number out of bounds."""
    for column, (name, limit) in zip(rows.T, fields, strict=True):
        bad = ~(np.abs(column) <= limit)  # true for NaN too
        if bad.any():
            k = int(bad.argmax())
            raise LogFormatError(
                path, f"{what} {k}, {name}: expected a number within +-{limit:g}, got {column[k]:g}"
            )


def _check(path: Path, drive: _Drive) -> None:
    if len(drive.scan_times) == 0 or len(drive.controls) == 0:
        raise LogFormatError(path, "has no scans or no controls")
    for what, times in (("scans", drive.scan_times), ("controls", drive.controls[:, 0])):
        _within(path, what, times[:, None], (_TIME,))
        if np.any(np.diff(times) <= 0.0):
            raise LogFormatError(path, f"the times of the {what} do not increase")
    _within(path, "control", drive.controls, _CONTROL)
    for k, found in enumerate(drive.detections):
        _within(path, f"scan {k}, trunk", found, _TRUNK)
        if np.any(found[:, 0] <= 0.0):
            raise LogFormatError(
                path, f"scan {k}, range: expected a number > 0 m, got {found[:, 0].min():g}"
            )


def twist_of(speed: float, steering: float) -> tuple[float, float, float]:
    """Body velocity (m/s, m/s, rad/s) of the laser: the README's vehicle model.

    The encoder sits on the left rear wheel, the laser ahead of the front axle and to its left.
    """
    tangent = math.tan(steering)
    forward = speed / (1.0 - tangent * HALF_TRACK_M / AXLES_M)
    omega = forward * tangent / AXLES_M
    return forward - omega * LASER_LEFT_M, omega * LASER_AHEAD_M, omega


class _DeadReckoning:
    """The pose along the controls, each of which holds until the next."""

    def __init__(self, controls: Float) -> None:
        self._controls: list[tuple[float, float, float]] = [tuple(c) for c in controls.tolist()]
        self._next = 0
        self._held = self._controls[0]
        self._time: float | None = None
        self.pose: Float = np.zeros(3)

    def advance(self, until: float) -> Float:
        """Move on to time ``until`` (s); the covariance (3, 3) of this increment."""
        if self._time is None:
            self._time = until
        by_speed, by_steering = np.zeros(3), np.zeros(3)
        while self._time < until:
            end = until
            if self._next < len(self._controls):
                end = min(until, max(self._controls[self._next][0], self._time))
            duration = end - self._time
            _, speed, steering = self._held
            twist = np.array(twist_of(speed, steering))
            self.pose = se2.compose(self.pose, se2.exp(twist, duration))
            by_speed += duration * (np.array(twist_of(speed + 0.01, steering)) - twist) / 0.01
            by_steering += duration * (np.array(twist_of(speed, steering + 0.01)) - twist) / 0.01
            self._time = end
            while self._next < len(self._controls) and self._controls[self._next][0] <= end:
                self._held = self._controls[self._next]
                self._next += 1
        covariance: Float = SPEED_STD**2 * np.outer(by_speed, by_speed)
        covariance += STEERING_STD**2 * np.outer(by_steering, by_steering)
        return covariance + 1e-8 * np.eye(3)


def _frames(path: Path, drive: _Drive) -> Iterator[Frame]:
    reckoning = _DeadReckoning(drive.controls)
    scans = zip(drive.scan_times.tolist(), drive.detections, strict=True)
    for k, (time_s, found) in enumerate(scans):
        with about(path, f"scan {k}"):
            frame = _frame(reckoning, time_s, found)
        yield frame


def _frame(reckoning: _DeadReckoning, time_s: float, found: Float) -> Frame:
    covariance = reckoning.advance(time_s)
    stamp_ns = round(time_s * NS_PER_S)
    odometry = Odometry(
        stamp_ns=stamp_ns, T_odom_robot=reckoning.pose, increment_covariance=covariance
    )
    return Frame(stamp_ns=stamp_ns, odometry=odometry, features=_features(stamp_ns, found))


def _features(stamp_ns: int, found: Float) -> Features:
    """Trunks (n, 3) range m, bearing rad from the right, diameter m, as points."""
    points, covariances = np.empty((len(found), 2)), np.empty((len(found), 2, 2))
    for k, (reach, from_right, _) in enumerate(found.tolist()):
        bearing = from_right - math.pi / 2.0
        c, s = math.cos(bearing), math.sin(bearing)
        radial, lateral = RANGE_STD_M**2, (reach * BEARING_STD) ** 2 + RANGE_STD_M**2 / 4.0
        across = c * s * (radial - lateral)
        points[k] = reach * c, reach * s
        covariances[k] = [
            [c * c * radial + s * s * lateral, across],
            [across, s * s * radial + c * c * lateral],
        ]
    return Features(stamp_ns=stamp_ns, points_robot=points, covariances=covariances)
