# SPDX-License-Identifier: Apache-2.0
"""Poses with their covariances, one a line: "wide TUM", which ``smfeval`` scores.

A line is that of a TUM file, ``t x y z qx qy qz qw``, and after it the lower triangle of a (6, 6)
covariance, row by row: c11 c21 c22 c31 ... c66, 21 numbers. Above the lines stands the header of
smfeval's own format SQUARE 0.3, each line of it a comment: without it they are the same file.

The covariance is of the tangent at the pose, translation before rotation, in the frame of the
*robot* (right perturbation). Ours is of x, y and heading along the axes of the *map*, so it is
turned. What a robot on a floor cannot do, z, roll and pitch, has the variance ``FLAT``.
"""

import math
from pathlib import Path

import numpy as np

from slam.checked import finite
from slam.errors import InvalidValueError
from slam.files import write_text
from slam.frames import Float
from slam.trajectory import Trajectory, tum_stamp

FLAT = 1e-10  # m², rad²: (10 um)², of z, roll, pitch; smfeval takes less than 1e-12 for none
ROUNDING = 1e-6  # of the trace of a covariance: a few times that of single precision
FORMAT = "SQUARE/0.3"
PLANAR = (0, 1, 5)  # x, y and yaw among x, y, z, roll, pitch, yaw
_LOWER = np.tril_indices(6)


def to_body(covariance: Float, theta: float) -> Float:
    """(3, 3) of x, y, heading along the axes of the map, as the robot's (6, 6), turned by theta."""
    turn = _turn(theta)
    whole = np.diag(np.full(6, FLAT))
    whole[np.ix_(PLANAR, PLANAR)] = turn.T @ covariance @ turn
    return whole


def _turn(theta: float) -> Float:
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def write_wide_tum(
    path: Path,
    trajectory: Trajectory,
    covariances: Float,
    *,
    epoch_ns: int = 0,
    algorithm: str = "shunting",
    version: str = "0",
) -> None:
    """Poses T_map_robot and their (n, 3, 3) covariances of x, y, heading in the map.

    epoch_ns   is added to each stamp: of a bag whose frames begin at 0 s (``slam.frames.EPOCH``)
    algorithm, version  words of the header

    The known first pose may have no variance: it gets ``FLAT``. Raises ``InvalidValueError`` for
    covariances of another shape, not finite, not symmetric or positive semidefinite to
    ``ROUNDING`` of their trace, or all of them zero: whoever states none cannot be scored.
    """
    covariances = _checked(np.asarray(covariances, dtype=np.float64), len(trajectory))
    lines = [f"#%{key} {value}" for key, value in _header(algorithm, version)]
    for stamp_ns, pose, covariance in zip(
        (trajectory.stamps_ns + epoch_ns).tolist(), trajectory.poses, covariances, strict=True
    ):
        x, y, theta = pose.tolist()
        numbers = [x, y, 0.0, 0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0)]
        numbers += to_body(covariance, theta)[_LOWER].tolist()
        lines.append(" ".join([tum_stamp(stamp_ns), *(repr(number) for number in numbers)]))
    write_text(path, "\n".join(lines) + "\n")


def _header(algorithm: str, version: str) -> list[tuple[str, str]]:
    """Names and values of smfeval's header. Gauge: the map begins at the known start."""
    for name, word in (("algorithm", algorithm), ("version", version)):
        if not word or not word.isprintable():
            raise InvalidValueError(f"{name} must be one line of text, got {word!r:.80}")
    return [
        ("FORMAT", FORMAT),
        ("REPRESENTATION", "gaussian_se3"),
        ("POSE_FRAME", "map"),
        ("BODY_FRAME", "robot"),
        ("GAUGE", "fixed"),
        ("TIMESTAMP_UNIT", "seconds"),
        ("ALGORITHM", algorithm),
        ("ALGORITHM_VERSION", version),
        ("TANGENT_CONVENTION", "right_perturbation"),
        ("TANGENT_ORDER", "translation_rotation"),
        ("ROTATION_PARAM", "axis_angle"),
    ]


def _checked(covariances: Float, n: int) -> Float:
    """Symmetric to the last bit, with ``FLAT`` more where they are singular."""
    if covariances.shape != (n, 3, 3):
        raise InvalidValueError(f"covariances must be ({n}, 3, 3), got {covariances.shape}")
    finite("wide TUM", "covariances", covariances)
    if n and not covariances.any():
        raise InvalidValueError("covariances are all zero: this SLAM states none to be scored")
    rounding = ROUNDING * np.abs(np.trace(covariances, axis1=1, axis2=2))
    transposed = covariances.transpose(0, 2, 1)
    skew = np.abs(covariances - transposed).max(axis=(1, 2))
    if (skew > rounding).any():
        k = int((skew - rounding).argmax())
        raise InvalidValueError(
            f"covariances must be symmetric, got entries {skew[k]:g} apart in scan {k}"
        )
    symmetric = 0.5 * (covariances + transposed)
    least = np.linalg.eigvalsh(symmetric)[:, 0]
    if (least < -rounding).any():
        k = int((least + rounding).argmin())
        raise InvalidValueError(
            f"covariances must be positive semidefinite, got an eigenvalue of {least[k]:g} in "
            f"scan {k}"
        )
    more = np.where(least < FLAT, FLAT + np.maximum(FLAT, -least), 0.0)
    return symmetric + more[:, None, None] * np.eye(3)
