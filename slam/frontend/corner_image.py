# SPDX-License-Identifier: Apache-2.0
"""Compiled parts of the corner extractor: a scan as an image, and where exactly a corner is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slam._jit import inner, njit
from slam.frontend.corner_config import CornerConfig

Float = NDArray[np.float64]
Bools = NDArray[np.bool_]

CORNERS = CornerConfig()
STEPS, CUT, FAINT = CORNERS.steps, CORNERS.cut, CORNERS.faint


@njit
def joined_beams(
    ranges: Float, valid: Bools, points: Float, step: float, slope: float, noise_m: float
) -> Bools:
    """(n,) True where beams i and i + 1 hit one surface.

    The adaptive breakpoint of Borges and Aldon (2004): their distance is at most what a surface
    seen at the grazing angle ``slope`` (rad) shows between two beams ``step`` (rad) apart.
    """
    n = len(ranges)
    joined = np.zeros(n, dtype=np.bool_)
    for i in range(n - 1):
        if valid[i] and valid[i + 1]:
            near = min(ranges[i], ranges[i + 1])
            most = near * math.sin(step) / math.sin(max(slope - step, 0.01)) + 3.0 * noise_m
            gap = math.hypot(points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1])
            joined[i] = gap <= most
    return joined


@njit
def draw(
    image: Float, widths: Float, points: Float, sigmas: Float, drawn: Bools, joined: Bools
) -> None:
    """Dots with peak 1 and those standard deviations (cells), joined where ``joined``.

    ``points`` (n, 2) column, row in cells; between joined ones there is a dot every half cell. Each
    pixel keeps the largest value and, in ``widths``, the standard deviation of that dot.
    """
    for i in range(len(points)):
        if not drawn[i]:
            continue
        _dot(image, widths, points[i, 0], points[i, 1], sigmas[i])
        if joined[i] and drawn[i + 1]:
            dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
            parts = int(math.hypot(dx, dy) / 0.5) + 1
            for k in range(1, parts):
                share = k / parts
                sigma = sigmas[i] + share * (sigmas[i + 1] - sigmas[i])
                x, y = points[i, 0] + share * dx, points[i, 1] + share * dy
                _dot(image, widths, x, y, sigma)


@inner
def _dot(image: Float, widths: Float, x: float, y: float, sigma: float) -> None:
    height, width = image.shape
    reach = CUT * sigma
    for row in range(max(0, math.ceil(y - reach)), min(height, math.floor(y + reach) + 1)):
        for column in range(max(0, math.ceil(x - reach)), min(width, math.floor(x + reach) + 1)):
            squared = ((column - x) ** 2 + (row - y) ** 2) / (sigma * sigma)
            value = math.exp(-0.5 * squared)
            if value > image[row, column]:
                image[row, column] = value
                widths[row, column] = sigma


@njit
def refine(
    image: Float, widths: Float, column: int, row: int, window: int
) -> tuple[float, float, Float, bool]:
    """The point where the drawn lines around a pixel meet or end, and its covariance (cells^2).

    Every pixel of the image knows the point of the drawing nearest to it, p + w^2 grad(log I), as
    I = exp(-d^2 / 2 w^2), and the direction n of the line there. Least squares over n . (p' - q),
    weighted by the squared gradient and by a Gaussian half as wide as the window that follows q,
    gives q with covariance s^2 (sum n n')^-1, s^2 being the mean residual (after Foerstner and
    Guelch 1987, whose gradients at the pixels themselves pull ends and corners outwards by a line's
    width). False where the gradients do not determine a point or it runs away from its start.
    """
    height, width = image.shape
    x, y = float(column), float(row)
    covariance = np.zeros((2, 2))
    for _ in range(STEPS):
        i0, j0 = round(x), round(y)
        if not (window < i0 < width - window - 1 and window < j0 < height - window - 1):
            return x, y, covariance, False
        a = b = c = u = v = residual = total = 0.0
        for j in range(j0 - window, j0 + window + 1):
            for i in range(i0 - window, i0 + window + 1):
                right, left = image[j, i + 1], image[j, i - 1]
                up, down = image[j + 1, i], image[j - 1, i]
                if min(min(right, left), min(up, down)) < FAINT:
                    continue
                squared = 0.5 * widths[j, i] ** 2
                dx = i - x + squared * math.log(right / left)
                dy = j - y + squared * math.log(up / down)
                gx, gy = 0.5 * (right - left), 0.5 * (up - down)
                weight = math.exp(-2.0 * ((i - x) ** 2 + (j - y) ** 2) / (window * window))
                along = gx * dx + gy * dy
                a += weight * gx * gx
                b += weight * gx * gy
                c += weight * gy * gy
                u += weight * gx * along
                v += weight * gy * along
                residual += weight * along * along
                total += weight * (gx * gx + gy * gy)
        determinant = a * c - b * b
        if determinant <= 1e-3 * (a + c) * (a + c):
            return x, y, covariance, False
        step_x, step_y = (c * u - b * v) / determinant, (a * v - b * u) / determinant
        x, y = x + step_x, y + step_y
        if max(abs(x - column), abs(y - row)) > window:
            return x, y, covariance, False
        # residual / total: squared distance in cells between the lines and q
        half = 0.5 * (a + c)
        covariance = np.array([[c, -b], [-b, a]]) * (residual / total * half / determinant)
        if abs(step_x) + abs(step_y) < 0.01:
            break
    return x, y, covariance, True
