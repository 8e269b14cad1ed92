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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slam.checked import is_number
from slam.errors import FAILURES, InvalidValueError, NotFiniteError, SlamFailedError
from slam.estimate import Estimate, Raster
from slam.frames import Features, Float, Frame, LaserSpec, Odometry, Scan
from slam.trajectory import Trajectory

PROTOCOL, VERSION = "mobilia-slam", 1
NO_RETURN, NO_RANGE, UNKNOWN = -1.0, -2.0, -1.0
MAX_CELLS = 1 << 26  # of a map, as many as ``map.pgm`` has: a square of 400 m at 5 cm

Message = Mapping[str, Any]
_NO_JSON_NUMBER = re.compile(
    r"(?<=[\[,:\s])([+-]?)(nan|inf)(?:inity)?(?:\([^)]{0,40}\))?(?=[\],}\s])", re.I
)
_NUMBERS = {int, float, type(None)}  # as JSON has them; True and False are none


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
    message: dict[str, Any] = {"type": "frame", "stamp_ns": frame.stamp_ns, "odometry": wheels}
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
        message["intensities"] = [
            v if math.isfinite(v) else None for v in scan.intensities.tolist()
        ]
    # by hand: json knows no float32, whose digits are a third of the double's
    ranges = np.where(np.isnan(scan.ranges), np.float32(NO_RANGE), scan.ranges)
    ranges[np.isinf(ranges)] = NO_RETURN
    return line(message)[:-2] + b',"ranges":[' + _float32s(ranges) + b"]}\n"


def _float32s(values: NDArray[np.float32]) -> bytes:
    return ",".join(map(str, values)).encode()


def _laser_message(spec: LaserSpec) -> dict[str, Any]:
    return {
        "n_beams": spec.n_beams,
        "angle_min": spec.angle_min,
        "angle_increment": spec.angle_increment,
        "range_min": spec.range_min,
        "range_max": spec.range_max,
        "beam_time_offsets": spec.beam_time_offsets.tolist(),
        "T_robot_laser": spec.T_robot_laser.tolist(),
        **({"range_sigma_m": spec.range_sigma_m} if spec.range_sigma_m else {}),
    }


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


def estimate_of(message: Message, stamp_ns: int) -> Estimate:
    """The estimate of the frame at ``stamp_ns``. No covariance means none is claimed: zero."""
    if message.get("stamp_ns") != stamp_ns or isinstance(message["stamp_ns"], bool):
        raise SlamFailedError(
            f"answered for {message.get('stamp_ns')!r:.40} ns instead of {stamp_ns} ns", "bad"
        )
    converged, diagnostics = message.get("converged", True), message.get("diagnostics", {})
    if not isinstance(converged, bool) or not isinstance(diagnostics, dict):
        raise SlamFailedError("answered a 'converged' that is no truth value, or 'diagnostics' "
                              "that are no object", "bad")  # fmt: skip
    covariance = np.zeros(9)
    if "covariance" in message:
        covariance = _numbers(message, "covariance", 9)
    with _judged():
        return Estimate(
            stamp_ns=stamp_ns,
            T_map_robot=_numbers(message, "T_map_robot", 3),
            covariance=covariance.reshape(3, 3),
            converged=converged,
            diagnostics=diagnostics,
        )


@contextmanager
def _judged(not_finite: str = "nan") -> Iterator[None]:
    """What no type of ours takes is "bad", or what is said for numbers that are not finite."""
    try:
        yield
    except (InvalidValueError, OverflowError) as error:
        outcome = not_finite if isinstance(error, NotFiniteError) else "bad"
        raise SlamFailedError(f"answered: {error}", outcome) from error


def _numbers(message: Message, key: str, length: int | None = None) -> Float:
    """A list of numbers; null is NaN, as several JSON writers have it."""
    values = message.get(key)
    if not isinstance(values, Sequence) or isinstance(values, str):
        raise SlamFailedError(f"answered a {key!r} that is no list: {values!r:.60}", "bad")
    if length is not None and len(values) != length:
        raise SlamFailedError(f"answered {len(values)} numbers as {key!r}, not {length}", "bad")
    if not set(map(type, values)) <= _NUMBERS:  # a map has millions
        raise SlamFailedError(f"answered a {key!r} that holds no numbers: {values!r:.60}", "bad")
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError as error:
        raise SlamFailedError(f"answered a number in {key!r} past all doubles", "bad") from error


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


def map_of(message: Message) -> Raster | None:
    """The map of an answer."""
    if message.get("values") is None:
        return None
    height, width = message.get("height"), message.get("width")
    if type(height) is not int or type(width) is not int or min(height, width) < 0:
        raise SlamFailedError(f"answered a map of {width!r:.20} x {height!r:.20} cells", "bad")
    if height * width > MAX_CELLS:
        raise SlamFailedError(
            f"answered a map of {width!r:.20} x {height!r:.20} cells; it may have {MAX_CELLS}: "
            "make its cells larger", "bad",
        )  # fmt: skip
    values = _numbers(message, "values", height * width)
    values[values == UNKNOWN] = np.nan
    resolution_m = message.get("resolution_m")
    if not is_number(resolution_m):
        raise SlamFailedError(f"answered a map of resolution {resolution_m!r:.40}", "bad")
    origin = _numbers(message, "T_map_origin", 3)
    with _judged("bad"), np.errstate(over="ignore"):  # past float32 is outside [0, 1], too
        cells = values.astype(np.float32).reshape(height, width)
        return Raster(values=cells, resolution_m=float(resolution_m), T_map_origin=origin)


def trajectory_message(trajectory: Trajectory) -> dict[str, Any]:
    """The answer to "trajectory": a flat list of x, y, theta for each stamp."""
    return {
        "type": "trajectory",
        "stamps_ns": trajectory.stamps_ns.tolist(),
        "poses": trajectory.poses.ravel().tolist(),
    }


def trajectory_of(message: Message) -> Trajectory:
    """The final poses of an answer."""
    stamps = message.get("stamps_ns")
    if not isinstance(stamps, list) or any(type(s) is not int for s in stamps):
        raise SlamFailedError("answered a trajectory whose 'stamps_ns' are no whole numbers", "bad")
    poses = _numbers(message, "poses", 3 * len(stamps)).reshape(-1, 3)
    with _judged():
        return Trajectory(stamps_ns=np.array(stamps, dtype=np.int64), poses=poses)


def at_end_message(estimates: Sequence[Estimate], spent_s: Sequence[float]) -> dict[str, Any]:
    """The answer to "estimates_at_end": an estimate of each frame, and what each took, s."""
    return {
        "type": "estimates_at_end",
        "estimates": [estimate_message(estimate) for estimate in estimates],
        "processor_s": list(spent_s),
    }


def at_end_of(message: Message, stamps_ns: Sequence[int]) -> list[tuple[Estimate, float]]:
    """The estimates of an answer, one for each of ``stamps_ns`` in order, and their times, s."""
    estimates = message.get("estimates")
    if not isinstance(estimates, list) or len(estimates) != len(stamps_ns):
        raise SlamFailedError(
            f"answered 'estimates' that are no list of {len(stamps_ns)}, one for each frame", "bad"
        )
    if not all(isinstance(one, dict) for one in estimates):
        raise SlamFailedError("answered 'estimates' that are no objects", "bad")
    spent_s = _numbers(message, "processor_s", len(stamps_ns))
    if not (np.isfinite(spent_s) & (spent_s >= 0.0)).all():
        raise SlamFailedError("answered 'processor_s' that are no times, finite and >= 0", "bad")
    read = [estimate_of(one, at) for one, at in zip(estimates, stamps_ns, strict=True)]
    return list(zip(read, spent_s.tolist(), strict=True))
