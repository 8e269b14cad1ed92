# SPDX-License-Identifier: Apache-2.0
"""Two legs that step: planted stance feet, a swing foot that is faster than the body.

A foot stays where it is put down until its turn comes; then it swings to where the hip will be
half a step later. Thigh and shank follow by two-link inverse kinematics, so a planted foot does not
slide. Lengths (thigh 0.455 m, shank 0.435 m, hip 0.90 m) are those of ``scenes/parts/person.xml``;
shorter legs would clip the reach and skate.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sim.core.state import Records
from slam._jit import inner, njit, uncounted
from slam.frames import Float

Int = NDArray[np.int64]

# columns of the state of the feet, (n, 8): feet l, r (x, y), phase of the swing in [0, 1], pause in
# double support s, which foot swings (-1 none), which swung last
FEET, PHASE, PAUSE, SWING, LAST = 0, 4, 5, 6, 7
N_COLUMNS = 8

THIGH, SHANK, HIP, HALF_WIDTH = 0.455, 0.435, 0.90, 0.09
SOLE = 0.010  # m, height of the lower end of a standing shank
REACH = 0.885  # m, a leg never quite straightens
LIFT = 0.10  # m
SEAT_HEIGHT, KNEES = 0.52, 0.42  # m, hips of who sits, and how far ahead of them the feet are
SWING_SHARE = 0.80  # of a step; the rest is double support


@inner
def step_time(speed: float) -> float:
    """Duration of one step, s: cadence 1.8 steps/s at 1 m/s, 2.2 at 1.3 m/s."""
    return min(max(0.80 - 0.26 * speed, 0.34), 0.75)


@njit
def rest_foot(x: float, y: float, yaw: float, foot: int) -> tuple[float, float]:
    """Where a foot stands under a body at rest."""
    side = HALF_WIDTH if foot == 0 else -HALF_WIDTH
    return x - side * math.sin(yaw), y + side * math.cos(yaw)


@inner
def swung(phase: float) -> float:
    """Share of the way a swinging foot has made: peak speed 1.3 times its mean."""
    return 0.4 * phase + 0.6 * phase * phase * (3.0 - 2.0 * phase)


@inner
def pick_foot(p: Float, pose: tuple[float, float, float], vx: float, vy: float) -> int:
    """The foot to lift now, -1: none. Walking: in turns; standing: one that is out of place."""
    x, y, yaw = pose
    away, lag = _behind(p, (x, y, yaw), vx, vy, 0)
    away_right, lag_right = _behind(p, (x, y, yaw), vx, vy, 1)
    if vx * vx + vy * vy > 0.0225:
        if away > 0.45 or away_right > 0.45 or abs(lag - lag_right) > 0.02:
            return 0 if lag > lag_right else 1
        return 1 - int(p[LAST])
    worst = 0 if away > away_right else 1
    return worst if max(away, away_right) > 0.07 else -1


@inner
def _behind(
    p: Float, pose: tuple[float, float, float], vx: float, vy: float, foot: int
) -> tuple[float, float]:
    """m by which a foot is out of its place at rest, and m * m/s by which it lags the motion."""
    rx, ry = rest_foot(pose[0], pose[1], pose[2], foot)
    dx, dy = p[FEET + 2 * foot] - rx, p[FEET + 2 * foot + 1] - ry
    return math.sqrt(dx * dx + dy * dy), -(dx * vx + dy * vy)


@inner
def step_feet(p: Float, pose: tuple[float, float, float], vx: float, vy: float, dt: float) -> None:
    """Advance the feet of one person by ``dt`` s under a body at ``pose`` moving at (vx, vy)."""
    x, y, yaw = pose
    duration = step_time(math.sqrt(vx * vx + vy * vy))
    if p[SWING] < 0.0:
        p[PAUSE] -= dt
        if p[PAUSE] > 0.0:
            return
        foot = pick_foot(p, pose, vx, vy)
        if foot < 0:
            return
        p[SWING], p[PHASE] = foot, 0.0
    foot = int(p[SWING])
    swing = SWING_SHARE * duration
    rx, ry = rest_foot(x, y, yaw, foot)
    # Aim half a stance ahead of where the hip will be at touch-down. The aim may change in flight
    # (a turn, a stop); the foot makes its share of the way that is left, so it never jumps.
    ahead = (1.0 - p[PHASE]) * swing + 0.5 * (2.0 * duration - swing)
    before = swung(p[PHASE])
    p[PHASE] = min(p[PHASE] + dt / swing, 1.0)
    share = (swung(p[PHASE]) - before) / (1.0 - before)
    p[FEET + 2 * foot] += share * (rx + ahead * vx - p[FEET + 2 * foot])
    p[FEET + 2 * foot + 1] += share * (ry + ahead * vy - p[FEET + 2 * foot + 1])
    if p[PHASE] >= 1.0:
        p[LAST], p[SWING] = foot, -1.0
        p[PAUSE] = (1.0 - SWING_SHARE) * duration


@inner
def quaternion(yaw: float, ax: float, ay: float, az: float, out: Float) -> None:
    """Orientation whose z axis is (ax, ay, az) in the heading frame and whose x looks ahead."""
    pitch, roll = 0.5 * math.atan2(ax, az), -0.5 * math.asin(min(max(ay, -1.0), 1.0))
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    cp, sp, cr, sr = math.cos(pitch), math.sin(pitch), math.cos(roll), math.sin(roll)
    w, i, j, k = cp * cr, cp * sr, sp * cr, -sp * sr  # pitch, then roll
    out[0], out[3] = cy * w - sy * k, cy * k + sy * w
    out[1], out[2] = cy * i - sy * j, cy * j + sy * i


@inner
def pose_leg(
    hip: tuple[float, float, float],
    yaw: float,
    foot: tuple[float, float, float],
    rows: tuple[int, int],
    mocap: tuple[Float, Float],
) -> None:
    """Thigh and shank from hip and foot: ``rows`` of positions and quaternions ``mocap``.

    The hip sinks a little where a long step asks for it, as a pelvis does.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = foot[0] - hip[0], foot[1] - hip[1]
    fx, fy = c * dx + s * dy, -s * dx + c * dy  # foot from hip, heading frame
    far = math.sqrt(fx * fx + fy * fy)
    if far > 0.6:  # out of reach after a hard shove: the foot is dragged
        fx, fy, far = fx * 0.6 / far, fy * 0.6 / far, 0.6
    top = min(hip[2], foot[2] + math.sqrt(REACH * REACH - far * far))
    fz = foot[2] - top
    length = math.sqrt(far * far + fz * fz)
    ux, uy, uz = fx / length, fy / length, fz / length
    a = (THIGH * THIGH - SHANK * SHANK + length * length) / (2.0 * length)
    h = math.sqrt(max(THIGH * THIGH - a * a, 0.0))
    kx, ky, kz = 1.0 - ux * ux, -ux * uy, -ux * uz  # the knee bends forwards
    norm = math.sqrt(kx * kx + ky * ky + kz * kz)
    nx, ny, nz = a * ux + h * kx / norm, a * uy + h * ky / norm, a * uz + h * kz / norm
    thigh, shank = mocap[0][rows[0]], mocap[0][rows[1]]
    thigh[0], thigh[1], thigh[2] = hip[0], hip[1], top
    shank[0], shank[1], shank[2] = hip[0] + c * nx - s * ny, hip[1] + s * nx + c * ny, top + nz
    quaternion(yaw, -nx / THIGH, -ny / THIGH, -nz / THIGH, mocap[1][rows[0]])
    quaternion(yaw, (nx - fx) / SHANK, (ny - fy) / SHANK, (nz - fz) / SHANK, mocap[1][rows[1]])


@njit
def stand(qpos: Float, addresses: Int, feet: Float) -> None:
    """Put both feet of everyone under the hips."""
    for i in range(feet.shape[0]):
        q = addresses[i, 0]
        for foot in range(2):
            x, y = rest_foot(qpos[q], qpos[q + 1], qpos[q + 2], foot)
            feet[i, FEET + 2 * foot], feet[i, FEET + 2 * foot + 1] = x, y
        feet[i, SWING] = -1.0


@uncounted
def walk(  # noqa: PLR0913 (kernel)
    dt: float,
    physics: tuple[Float, Float],
    addresses: Int,
    limbs: Int,
    feet: Float,
    state: Records,
    mocap: tuple[Float, Float],
) -> None:
    """Advance all feet by ``dt`` s and pose all limbs.

    physics    qpos and qvel
    addresses  (n, 2) first qpos and dof of each torso
    limbs      (n, 4) mocap rows of thigh_l, shank_l, thigh_r, shank_r
    feet       (n, 8) state
    state      (n,) of ``columns``, whose ``sit`` is 0 stands to 1 sits: hips sink, feet go forward
    mocap      positions and quaternions, written
    """
    qpos, qvel = physics
    for i in range(feet.shape[0]):
        q, v = addresses[i]
        pose = (qpos[q], qpos[q + 1], qpos[q + 2])
        p, sit = feet[i], state[i].sit
        forward, height = KNEES * sit, HIP - (HIP - SEAT_HEIGHT) * sit
        if dt > 0.0:
            over = (
                pose[0] + forward * math.cos(pose[2]),
                pose[1] + forward * math.sin(pose[2]),
                pose[2],
            )
            step_feet(p, over, qvel[v], qvel[v + 1], dt)
        for foot in range(2):
            lift = LIFT * math.sin(math.pi * p[PHASE] ** 0.7) if p[SWING] == foot else 0.0
            place = (p[FEET + 2 * foot], p[FEET + 2 * foot + 1], SOLE + lift)
            x, y = rest_foot(pose[0], pose[1], pose[2], foot)
            rows = (limbs[i, 2 * foot], limbs[i, 2 * foot + 1])
            pose_leg((x, y, height), pose[2], place, rows, mocap)
