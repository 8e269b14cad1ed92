# SPDX-License-Identifier: Apache-2.0
"""The messages between mobilia and a SLAM in a process of its own: one JSON object per line.

docs/bring_your_own.md is the specification. Strict JSON: a range of -1 stands for no return (+inf),
-2 for an error code (NaN), a cell of -1 for unknown, null for no intensity. Doubles have the digits
that give back the same double, ranges and cells the same float32. Matrices are flat, row by row.

``…_message`` makes a message, ``…_of`` reads it. What is read of a guest's words raises
``SlamFailedError`` with outcome "nan" or "bad".
"""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import fields
from typing import Annotated, Any, TypeVar

import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from slam.checked import MOST_NS
from slam.errors import FAILURES, InvalidValueError, NotFiniteError, SlamFailedError
from slam.estimate import Estimate, Raster
from slam.frames import Features, Float, Frame, LaserSpec, Odometry, Scan
from slam.shaped import NotNegative, shaped
from slam.trajectory import Trajectory

PROTOCOL, VERSION = "mobilia-slam", 1
NO_RETURN, NO_RANGE, UNKNOWN = -1.0, -2.0, -1.0
MAX_CELLS = 1 << 26  # of a map, as many as ``map.pgm`` has: a square of 400 m at 5 cm

Message = Mapping[str, Any]
_NO_JSON_NUMBER = re.compile(
    r"(?<=[\[,:\s])([+-]?)(nan|inf)(?:inity)?(?:\([^)]{0,40}\))?(?=[\],}\s])", re.I
)
_Pose = tuple[float | None, float | None, float | None]
_Nine = Annotated[tuple[float | None, ...], Meta(min_length=9, max_length=9)]
_Count = Annotated[int, Meta(ge=0, le=MAX_CELLS)]
_Stamp = Annotated[int, Meta(ge=-MOST_NS, le=MOST_NS)]
S = TypeVar("S", bound=Struct)


def line(message: Message) -> bytes:
    """A message as it goes over the pipe."""
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def message_of(text: bytes) -> dict[str, Any]:
    """The object of one line; the nan and inf of C and Python are understood, to be scored so."""
    message: Any = None
    with suppress(ValueError, RecursionError):
        words = text.decode()
        try:
            message = json.loads(words)
        except ValueError:
            message = json.loads(_NO_JSON_NUMBER.sub("NaN", words))
    if not isinstance(message, dict):
        shown = text.decode(errors="replace").strip()[:80]
        raise SlamFailedError(f"answered no JSON object but {shown!r}", "bad")
    return message


def hello_message() -> dict[str, Any]:
    """What is said first."""
    return {"type": "hello", "protocol": PROTOCOL, "version": VERSION}


def check_hello(message: Message) -> None:
    """Raise ``SlamFailedError`` unless the guest speaks this protocol and version."""
    spoken = (message.get("protocol"), message.get("version"))
    if spoken != (PROTOCOL, VERSION):
        raise SlamFailedError(
            f"speaks {spoken[0]!r} version {spoken[1]!r}, not {PROTOCOL!r} version {VERSION}", "bad"
        )


def error_message(words: str, outcome: str) -> dict[str, Any]:
    """What a guest answers in place of anything it cannot give."""
    return {"type": "error", "message": words, "outcome": outcome}


def failure_of(message: Message) -> SlamFailedError:
    """The failure that a guest reports of itself; "raised" unless it says otherwise."""
    words = " ".join(str(message.get("message", "")).split())[:400] or "an error without words"
    outcome = message.get("outcome")
    return SlamFailedError(words, outcome if outcome in FAILURES else "raised")


def frame_line(frame: Frame, known: LaserSpec | None) -> bytes:
    """A frame without truth; the scanner goes along where it is not ``known`` yet."""
    odometry = frame.odometry
    wheels: dict[str, Any] = {"T_odom_robot": odometry.T_odom_robot.tolist()}
    if odometry.increment_covariance is not None:
        wheels["increment_covariance"] = odometry.increment_covariance.ravel().tolist()
    if odometry.twist is not None:
        wheels["twist"] = odometry.twist.tolist()
    message = {"type": "frame", "stamp_ns": frame.stamp_ns, "odometry": wheels}
    if frame.features is not None:
        message["features"] = {
            "points_robot": frame.features.points_robot.tolist(),
            "covariances": frame.features.covariances.reshape(-1, 4).tolist(),
        }
    scan = frame.scan
    if scan is None:
        return line(message)
    if known is None or scan.spec != known:
        message["laser"] = _laser_message(scan.spec)
    if scan.intensities is not None:
        message["intensities"] = _plain(scan.intensities)
    # by hand: json knows no float32, whose digits are a third of the double's
    ranges = np.where(np.isnan(scan.ranges), np.float32(NO_RANGE), scan.ranges)
    ranges[np.isinf(ranges)] = NO_RETURN
    return line(message)[:-2] + b',"ranges":[' + _float32s(ranges) + b"]}\n"


def _float32s(values: NDArray[np.float32]) -> bytes:
    return ",".join(map(str, values)).encode()


def _laser_message(spec: LaserSpec) -> dict[str, Any]:
    """All that a scanner is, its noise where that is known."""
    names = [own.name for own in fields(spec) if own.init and own.name != "range_sigma_m"]
    noise = {"range_sigma_m": spec.range_sigma_m} if spec.range_sigma_m else {}
    return {**{name: _plain(getattr(spec, name)) for name in names}, **noise}


def frame_of(message: Message, known: LaserSpec | None) -> Frame:
    """The frame of a message of ours, for guests written in Python."""
    stamp_ns, wheels = message["stamp_ns"], message["odometry"]
    matrix = wheels.get("increment_covariance")
    odometry = Odometry(
        stamp_ns=stamp_ns,
        T_odom_robot=wheels["T_odom_robot"],
        increment_covariance=None if matrix is None else np.reshape(matrix, (3, 3)),
        twist=wheels.get("twist"),
    )
    features = message.get("features")
    if features is not None:
        features = Features(
            stamp_ns=stamp_ns,
            points_robot=np.reshape(features["points_robot"], (-1, 2)),
            covariances=np.reshape(features["covariances"], (-1, 2, 2)),
        )
    scan = _scan_of(message, known) if "ranges" in message else None
    return Frame(stamp_ns=stamp_ns, odometry=odometry, scan=scan, features=features)


def _scan_of(message: Message, known: LaserSpec | None) -> Scan:
    spec = LaserSpec(**message["laser"]) if "laser" in message else known
    if spec is None:
        raise InvalidValueError("the first frame with ranges must bring its laser")
    ranges = np.array(message["ranges"], dtype=np.float32)
    ranges[ranges == NO_RETURN] = np.inf
    ranges[ranges == NO_RANGE] = np.nan
    intensities = message.get("intensities")
    return Scan(
        stamp_ns=message["stamp_ns"],
        ranges=ranges,
        spec=spec,
        intensities=None if intensities is None else np.array(intensities, dtype=np.float32),
    )


def estimate_message(estimate: Estimate) -> dict[str, Any]:
    """The answer to a frame."""
    return {
        "type": "estimate",
        "stamp_ns": int(estimate.stamp_ns),
        "T_map_robot": estimate.T_map_robot.tolist(),
        "covariance": estimate.covariance.ravel().tolist(),
        "converged": bool(estimate.converged),
        "diagnostics": _plain(estimate.diagnostics),
    }


def _plain(value: Any) -> Any:
    """As strict JSON has it: NumPy's numbers as Python's, what is no number as null."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (np.generic, np.ndarray)):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


class _Estimate(Struct):
    stamp_ns: int
    T_map_robot: _Pose
    covariance: _Nine = (0.0,) * 9
    converged: bool = True
    diagnostics: dict[str, Any] = {}


def estimate_of(message: Message, stamp_ns: int) -> Estimate:
    """The estimate of the frame at ``stamp_ns``. No covariance means none is claimed: zero."""
    return _estimate(_read(message, _Estimate), stamp_ns)


def _estimate(said: _Estimate, stamp_ns: int) -> Estimate:
    if said.stamp_ns != stamp_ns:
        raise SlamFailedError(f"answered for {said.stamp_ns} ns instead of {stamp_ns} ns", "bad")
    with _judged():
        return Estimate(
            stamp_ns=stamp_ns,
            T_map_robot=_floats(said.T_map_robot),
            covariance=_floats(said.covariance).reshape(3, 3),
            converged=said.converged,
            diagnostics=said.diagnostics,
        )


def _read(message: Message, kind: type[S]) -> S:
    """An answer of that kind; null is NaN, as several JSON writers have it."""
    with _judged():
        found: S = shaped("", message, kind)
    return found


def _floats(values: Sequence[float | None]) -> Float:
    return np.array(values, dtype=np.float64)


@contextmanager
def _judged(not_finite: str = "nan") -> Iterator[None]:
    """What no type of ours takes is "bad", or what is said for numbers that are not finite."""
    try:
        yield
    except (InvalidValueError, OverflowError) as error:
        outcome = not_finite if isinstance(error, NotFiniteError) else "bad"
        raise SlamFailedError(f"answered: {error}", outcome) from error


def map_message(raster: Raster | None) -> bytes:
    """The answer to "map"; without "values" there is none."""
    if raster is None:
        return line({"type": "map"})
    height, width = raster.values.shape
    head = line(
        {
            "type": "map",
            "width": width,
            "height": height,
            "resolution_m": float(raster.resolution_m),
            "T_map_origin": raster.T_map_origin.tolist(),
        }
    )
    values = np.where(np.isnan(raster.values), np.float32(UNKNOWN), raster.values)
    return head[:-2] + b',"values":[' + _float32s(values.ravel()) + b"]}\n"


class _Map(Struct):
    width: _Count
    height: _Count
    resolution_m: float
    T_map_origin: _Pose
    values: list[float | None]


def map_of(message: Message) -> Raster | None:
    """The map of an answer."""
    if message.get("values") is None:
        return None
    said: _Map = _read(message, _Map)
    cells = said.width * said.height
    if cells > MAX_CELLS:
        raise SlamFailedError(
            f"answered a map of {said.width} x {said.height} cells; it may have {MAX_CELLS}: "
            "make its cells larger", "bad",
        )  # fmt: skip
    _check_count("values", said.values, cells)
    values = _floats(said.values)
    values[values == UNKNOWN] = np.nan
    with _judged("bad"), np.errstate(over="ignore"):  # past float32 is outside [0, 1], too
        return Raster(
            values=values.astype(np.float32).reshape(said.height, said.width),
            resolution_m=said.resolution_m,
            T_map_origin=_floats(said.T_map_origin),
        )


def _check_count(what: str, values: Sequence[object], wanted: int) -> None:
    if len(values) != wanted:
        raise SlamFailedError(f"answered {len(values)} {what}, not {wanted}", "bad")


def trajectory_message(trajectory: Trajectory) -> dict[str, Any]:
    """The answer to "trajectory": a flat list of x, y, theta for each stamp."""
    return {
        "type": "trajectory",
        "stamps_ns": trajectory.stamps_ns.tolist(),
        "poses": trajectory.poses.ravel().tolist(),
    }


class _Trajectory(Struct):
    stamps_ns: list[_Stamp]
    poses: list[float | None]


def trajectory_of(message: Message) -> Trajectory:
    """The final poses of an answer."""
    said: _Trajectory = _read(message, _Trajectory)
    _check_count("numbers as 'poses'", said.poses, 3 * len(said.stamps_ns))
    with _judged():
        return Trajectory(
            stamps_ns=np.array(said.stamps_ns, dtype=np.int64),
            poses=_floats(said.poses).reshape(-1, 3),
        )


def at_end_message(estimates: Sequence[Estimate], spent_s: Sequence[float]) -> dict[str, Any]:
    """The answer to "estimates_at_end": an estimate of each frame, and what each took, s."""
    return {
        "type": "estimates_at_end",
        "estimates": [estimate_message(estimate) for estimate in estimates],
        "processor_s": list(spent_s),
    }


class _AtEnd(Struct):
    estimates: list[_Estimate]
    processor_s: list[NotNegative]


def at_end_of(message: Message, stamps_ns: Sequence[int]) -> list[tuple[Estimate, float]]:
    """The estimates of an answer, one for each of ``stamps_ns`` in order, and their times, s."""
    said: _AtEnd = _read(message, _AtEnd)
    _check_count("estimates, one for each frame", said.estimates, len(stamps_ns))
    _check_count("times as 'processor_s'", said.processor_s, len(stamps_ns))
    read = [_estimate(one, at) for one, at in zip(said.estimates, stamps_ns, strict=True)]
    return list(zip(read, said.processor_s, strict=True))
