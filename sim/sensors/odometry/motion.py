# SPDX-License-Identifier: Apache-2.0
"""One motion of the wheels and what it does to pose, increment and covariance, compiled."""

import math

import numpy as np

from slam._jit import inner, njit
from slam.frames import Float

Vec3 = tuple[float, float, float]

# What tyres creep in one scan while the encoders stand still, and what keeps a covariance
# invertible: (20 um)^2 and (20 urad)^2.
FLOOR = 4e-10
SLIP_MIN, SLIP_MAX = math.radians(1.0), math.radians(3.0)  # fidelity note, 2.4
SLIP_MEAN_SQUARE = (SLIP_MIN**2 + SLIP_MIN * SLIP_MAX + SLIP_MAX**2) / 3.0

# Parameters of a run: variances per metre and per radian, slips per metre, ticks per metre (0 for
# none), m between the true and between the nominal wheels, reported metres per metre of each rim.
TRANS_M, TRANS_RAD, ROT_M, ROT_RAD, SIDE_M, SLIP, SLIP_CONTACT = range(7)
TICKS, TRACK, NOMINAL, GAIN = 7, 8, 9, 10
REPORTED, COUNTED, TRUE = 0, 1, 2  # rows of the wheels
NOW, AT_STAMP, INCREMENT = 0, 1, 2  # rows of the poses


@inner
def _turned(distance: float, angle: float) -> tuple[float, float, float, float]:
    """(dx, dy) of an arc of that length and angle, and d(dx)/d(angle), d(dy)/d(angle)."""
    if abs(angle) < 1e-4:
        half = 0.5 * angle
        return distance, distance * half, -distance * angle / 3.0, 0.5 * distance
    s, c = math.sin(angle), math.cos(angle)
    dx, dy = distance * s / angle, distance * (1.0 - c) / angle
    return dx, dy, (distance * c - dx) / angle, (distance * s - dy) / angle


@inner
def _chain(pose: Float, bx: float, by: float, angle: float) -> None:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    pose[0] += c * bx - s * by
    pose[1] += s * bx + c * by
    pose[2] += angle


@inner
def _way(distance: float, side: float) -> Vec3:
    """Length of a motion ahead and to the left, and its direction: the error of the length lies
    along the way."""
    if side == 0.0:
        return abs(distance), 1.0, 0.0
    length = math.sqrt(distance * distance + side * side)
    return length, distance / length, side / length


@inner
def _accumulate(
    increment: Float, random: Float, systematic: Float, step: Vec3, variances: Vec3, track: float
) -> None:
    """Chain one small motion and its error onto the increment since the last frame, in place.

    increment   (3,) x, y, theta in the frame of the increment's start
    random      (3, 3) covariance of those three numbers by the random part
    systematic  (3, 3) their derivatives by Es - 1, Eb - 1, Ed - 1
    step        distance m, side m, angle rad; ``variances`` of its length, side and angle

    First order, as ``se2.propagate``: F P F' + G Q G' with the Jacobians of composition.
    """
    distance, side, angle = step
    bx, by, bx_angle, by_angle = _turned(distance, angle)
    unit_x, unit_y, _, _ = _turned(1.0, angle)
    c, s = math.cos(increment[2]), math.sin(increment[2])
    carry = np.zeros((3, 3))
    carry[0, 0] = carry[1, 1] = carry[2, 2] = 1.0
    carry[0, 2] = -s * bx - c * (by + side)
    carry[1, 2] = c * bx - s * (by + side)
    # Columns: what one unit of distance, side, angle does to the increment.
    fresh = np.zeros((3, 3))
    fresh[0, 0], fresh[1, 0] = c * unit_x - s * unit_y, s * unit_x + c * unit_y
    fresh[0, 1], fresh[1, 1] = -s, c
    fresh[0, 2], fresh[1, 2] = c * bx_angle - s * by_angle, s * bx_angle + c * by_angle
    fresh[2, 2] = 1.0
    _, ahead, aside = _way(distance, side)
    erring = fresh.copy()  # the same for length, side, angle
    for i in range(2):
        erring[i, 0] = ahead * fresh[i, 0] + aside * fresh[i, 1]
    # Rows distance, side, angle; columns Es, Eb, Ed (first order about 1).
    by_parameter = np.zeros((3, 3))
    by_parameter[0, 0], by_parameter[0, 2] = -distance, -0.25 * track * angle
    by_parameter[1, 0] = -side
    by_parameter[2, 0], by_parameter[2, 1], by_parameter[2, 2] = -angle, angle, -distance / track
    old_random, old_systematic = random.copy(), systematic.copy()
    for i in range(3):
        for j in range(3):
            variance, derivative = 0.0, 0.0
            for k in range(3):
                variance += erring[i, k] * variances[k] * erring[j, k]
                derivative += fresh[i, k] * by_parameter[k, j] + carry[i, k] * old_systematic[k, j]
                for m in range(3):
                    variance += carry[i, k] * old_random[k, m] * carry[j, m]
            random[i, j] = variance
            systematic[i, j] = derivative
    _chain(increment, bx, by + side, angle)


@inner
def _draw(
    distance: float, angle: float, contact: bool, p: Float, normals: Float, uniforms: Float
) -> tuple[Vec3, Vec3]:
    """(variances, drawn errors) of distance, side and angle; distance and angle without sign."""
    trans = p[TRANS_M] * distance + p[TRANS_RAD] * angle
    rot = p[ROT_M] * distance + p[ROT_RAD] * angle
    side = p[SIDE_M] * distance
    chance = 1.0 - math.exp(-(p[SLIP] + (p[SLIP_CONTACT] if contact else 0.0)) * distance)
    size = SLIP_MIN + (SLIP_MAX - SLIP_MIN) * abs(2.0 * uniforms[1] - 1.0)
    slip = math.copysign(size, uniforms[1] - 0.5) if uniforms[0] < chance else 0.0
    noise = (
        math.sqrt(trans) * normals[0],
        math.sqrt(side) * normals[1],
        math.sqrt(rot) * normals[2] + slip,
    )
    rot += chance * SLIP_MEAN_SQUARE
    # An extra length driven on an extra half turn: the one second-order term that matters,
    # because nothing of first order is sideways but ``side``.
    return (trans, side + 0.25 * trans * rot, rot), noise


@njit
def update(  # noqa: PLR0913 (kernel)
    travel: Vec3,
    contact: bool,
    p: Float,
    normals: Float,
    uniforms: Float,
    wheels: Float,
    poses: Float,
    spread: Float,
) -> None:
    """Advance all of a run's state to the true rim travel (left m, right m, sideways m).

    p       parameters, in the columns named above
    wheels  (3, 3) m of each rim and sideways: reported before ticks, after ticks, true
    poses   (3, 3) now, at the last stamp, increment since then
    spread  (3, 3, 3) random and systematic part of ``_accumulate``, covariance at the stamp
    """
    dl, dr = travel[0] - wheels[TRUE, 0], travel[1] - wheels[TRUE, 1]
    side = travel[2] - wheels[TRUE, 2]
    distance, angle = 0.5 * (dl + dr), (dr - dl) / p[TRACK]
    length, ahead, aside = _way(distance, side)
    variances, noise = _draw(length, abs(angle), contact, p, normals, uniforms)
    half, counted = 0.5 * p[NOMINAL] * noise[2], np.empty(3)
    rims = (
        p[GAIN] * dl + ahead * noise[0] - half,
        p[GAIN + 1] * dr + ahead * noise[0] + half,
        0.5 * (p[GAIN] + p[GAIN + 1]) * side + aside * noise[0],
    )
    for k in range(3):
        wheels[TRUE, k] = travel[k]
        wheels[REPORTED, k] += rims[k]
        after = wheels[REPORTED, k]
        if p[TICKS] > 0.0:
            after = math.floor(after * p[TICKS] + 0.5) / p[TICKS]
        counted[k] = after - wheels[COUNTED, k]
        wheels[COUNTED, k] = after
    turned = (counted[1] - counted[0]) / p[NOMINAL]
    along = 0.5 * (counted[0] + counted[1])
    _step_pose(poses[NOW], (along, counted[2]), noise[1], turned)
    _accumulate(
        poses[INCREMENT], spread[0], spread[1], (distance, side, angle), variances, p[TRACK]
    )


@inner
def close(poses: Float, spread: Float, variances: Vec3) -> None:
    """End the increment here: its covariance, then nothing moved.

    random + systematic diag(variances) systematic' + floor, exactly symmetric.
    """
    random, systematic, out = spread[0], spread[1], spread[2]
    for i in range(3):
        for j in range(i + 1):
            total = 0.5 * (random[i, j] + random[j, i])
            for k in range(3):
                total += systematic[i, k] * variances[k] * systematic[j, k]
            out[i, j] = out[j, i] = total
        out[i, i] += FLOOR
    for i in range(3):
        poses[AT_STAMP, i] = poses[NOW, i]
        poses[INCREMENT, i] = 0.0
        for j in range(3):
            random[i, j] = systematic[i, j] = 0.0


@inner
def _step_pose(pose: Float, rolled: tuple[float, float], slid: float, angle: float) -> None:
    bx, by, _, _ = _turned(rolled[0], angle)
    left, back, _, _ = _turned(rolled[1], angle)  # the same arc, begun to the left
    _chain(pose, bx - back, by + left + slid, angle)


@inner
def _at(travel: Float, step: float) -> Vec3:
    """Between the rows of ``travel`` (steps + 1, 3)."""
    k = min(int(step), len(travel) - 2)
    part, here, after = step - k, travel[k], travel[k + 1]
    return (
        here[0] + part * (after[0] - here[0]),
        here[1] + part * (after[1] - here[1]),
        here[2] + part * (after[2] - here[2]),
    )


@njit
def over_scan(  # noqa: PLR0913 (kernel)
    travel: Float,
    span: tuple[float, float],
    contact: bool,
    p: Float,
    draws: tuple[Float, Float, Float, Float],
    variances: Vec3,
    wheels: Float,
    poses: Float,
    spread: Float,
) -> None:
    """Two updates: to the first beam of a scan, where the increment ends, and to the last.

    travel  (steps + 1, 3) m rolled at the steps of the scan; ``span`` the steps of both beams
    draws   normals and uniforms of the first update, then of the second
    """
    first, last = _at(travel, span[0]), _at(travel, span[1])
    update(first, contact, p, draws[0], draws[1], wheels, poses, spread)
    close(poses, spread, variances)
    update(last, contact, p, draws[2], draws[3], wheels, poses, spread)
