# SPDX-License-Identifier: Apache-2.0
"""General-purpose point features of a scan (Li and Olson 2010): corners, ends, thin posts.

The scan becomes an image in which every point is as wide as it is uncertain, and the corner
detector of image processing (Kanade and Tomasi: the smaller eigenvalue of the gradients' second
moments) finds whatever can be located in two directions, without a model of what it is. What only
looks like an end is left out: the edge of a shadow that something nearer throws, the limit of the
field of view, and mixed pixels, whose beam hit two surfaces and measured neither.
"""

import math

import cv2
import numpy as np

from slam._jit import inner, njit
from slam.arrays import Bools, Float
from slam.frames import Features, Scan
from slam.frontend.deskew import end_points

CELL_M = 0.04  # m, edge of a pixel of the image into which a scan is drawn
RANGE_M = 12.0  # m; returns beyond are not drawn
RESPONSE = 0.25  # least corner response, over that of a lone thin post
NOISE_M = 0.01  # m, deviation of a range
FLOOR_M = 0.015  # m, least deviation: round things shift with the viewpoint
GRAZING_DEG = 10.0  # flattest view at which hits are one surface; breakpoint, Borges and Aldon 2004
FLAT_DEG = 12.0  # flattest angle of view at which the end of a surface is a corner
FAILED = 2  # beams in a row that may have failed inside a surface
BLOCK = 5  # pixels, edge of the window over which gradients are summed; Kanade and Tomasi
IDEAL = 0.14  # corner response to one dot of 1.2 cells; measured, block of 5
MIN_SIGMA_CELLS = 1.2  # cells, least width of a drawn dot
WINDOW = 4  # cells, half width of the window that refines a corner
PEAK_CELLS = 4  # cells, least distance between two corners
MARGIN_CELLS = 12  # cells, empty margin round the drawn scan
STEPS = 12  # most steps that refine a corner
CUT = 3.5  # deviations at which a drawn dot ends
FAINT = 0.01  # grey; pixels below say nothing of a line


@njit
def joined_beams(ranges: Float, valid: Bools, points: Float, step: float, slope: float) -> Bools:
    """(n,) True where beams i and i + 1 hit one surface.

    The adaptive breakpoint of Borges and Aldon (2004): their distance is at most what a surface
    seen at the grazing angle ``slope`` (rad) shows between two beams ``step`` (rad) apart.
    """
    n = len(ranges)
    joined = np.zeros(n, dtype=np.bool_)
    for i in range(n - 1):
        if valid[i] and valid[i + 1]:
            near = min(ranges[i], ranges[i + 1])
            most = near * math.sin(step) / math.sin(max(slope - step, 0.01)) + 3.0 * NOISE_M
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
def refine(image: Float, widths: Float, column: int, row: int) -> tuple[float, float, Float, bool]:
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
        if not (WINDOW < i0 < width - WINDOW - 1 and WINDOW < j0 < height - WINDOW - 1):
            return x, y, covariance, False
        a = b = c = u = v = residual = total = 0.0
        for j in range(j0 - WINDOW, j0 + WINDOW + 1):
            for i in range(i0 - WINDOW, i0 + WINDOW + 1):
                right, left = image[j, i + 1], image[j, i - 1]
                up, down = image[j + 1, i], image[j - 1, i]
                if min(min(right, left), min(up, down)) < FAINT:
                    continue
                squared = 0.5 * widths[j, i] ** 2
                dx = i - x + squared * math.log(right / left)
                dy = j - y + squared * math.log(up / down)
                gx, gy = 0.5 * (right - left), 0.5 * (up - down)
                weight = math.exp(-2.0 * ((i - x) ** 2 + (j - y) ** 2) / (WINDOW * WINDOW))
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
        if max(abs(x - column), abs(y - row)) > WINDOW:
            return x, y, covariance, False
        # residual / total: squared distance in cells between the lines and q
        half = 0.5 * (a + c)
        covariance = np.array([[c, -b], [-b, a]]) * (residual / total * half / determinant)
        if abs(step_x) + abs(step_y) < 0.01:
            break
    return x, y, covariance, True


FAR_M = 1e6  # stands for no return


def corners(scan: Scan, *, twist: Float | None = None) -> Features:
    """Corners of ``scan`` in the robot frame at its stamp, de-skewed with the body ``twist``."""
    points = _points(scan, twist)
    ranges = answered(scan)
    step = scan.spec.angle_increment
    joined = joined_beams(ranges, scan.valid, points, step, math.radians(GRAZING_DEG))
    valid, false_ends = _judge_ends(ranges, scan.valid, joined)
    false_ends |= valid & _flat(points, scan, joined, math.radians(FLAT_DEG))
    near = ranges <= RANGE_M
    false_ends |= valid & near & _beside(joined, ~near)  # only the limit of drawing
    valid, false_ends = valid & near, false_ends & near
    if not valid.any():
        return _features(scan, [], [])
    image, widths, origin = _draw(points, ranges, valid, joined, step)
    found, covariances = [], []
    for column, row in _peaks(image):
        x, y, cells, ok = refine(image, widths, column, row)
        point = origin + CELL_M * np.array([x, y])
        away = np.where(valid, ((points - point) ** 2).sum(axis=1), np.inf)
        beam = int(away.argmin())
        if not ok or _misleads(point, beam, points, false_ends):
            continue
        found.append(point)
        gap = _gap(beam, points, joined, ranges[beam] * step)
        covariances.append(_covariance(cells, gap))
    return _features(scan, found, covariances)


def answered(scan: Scan) -> Float:
    """(n,) m: ranges; ``FAR_M`` where nothing is, -1 where a beam failed."""
    failed = np.isnan(scan.ranges)
    ranges = np.where(failed, -1.0, np.minimum(scan.ranges, FAR_M, dtype=np.float64))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], failed, [False]])))
    for first, past in edges.reshape(-1, 2).tolist():
        if past - first > FAILED:
            ranges[first:past] = FAR_M
    return ranges


def _points(scan: Scan, twist: Float | None) -> Float:
    """(n, 2) end points in the robot frame at the stamp; what has no range lies at the laser."""
    spec = scan.spec
    ranges = np.where(scan.valid, scan.ranges, 0.0).astype(np.float64)
    still = np.zeros(3) if twist is None else np.asarray(twist, dtype=np.float64)
    return end_points(ranges, spec.angles, spec.beam_time_offsets, spec.T_robot_laser, still)


def _judge_ends(ranges: Float, valid: Bools, joined: Bools) -> tuple[Bools, Bools]:
    """Points worth drawing, and which of them are ends that are not where a surface ends.

    A lone point whose range lies between its neighbours' is a mixed pixel. An end is false where
    the next beam is shorter (a shadow begins), failed (NaN), or is not there (end of the scan).
    """
    n = len(ranges)
    to_next = joined & valid
    to_previous = np.zeros(n, dtype=np.bool_)
    to_previous[1:] = to_next[:-1]
    before, after = np.full(n, -1.0), np.full(n, -1.0)  # -1: nothing known there
    before[1:], after[:-1] = ranges[:-1], ranges[1:]
    between = (before - ranges) * (after - ranges) < 0.0
    mixed = valid & ~to_next & ~to_previous & between
    kept = valid & ~mixed
    for side, shift in ((before, 1), (after, -1)):  # an end next to a mixed pixel looks past it
        beyond = np.roll(side, shift)
        beside_mixed = np.roll(mixed, shift)
        side[beside_mixed] = beyond[beside_mixed]
    false_end = (~to_previous & (before < ranges)) | (~to_next & (after < ranges))
    return kept, kept & false_end


def _beside(joined: Bools, these: Bools) -> Bools:
    """Points joined to one of ``these``."""
    out: Bools = joined & np.append(these[1:], False)
    out[1:] |= joined[:-1] & these[:-1]
    return out


def _flat(points: Float, scan: Scan, joined: Bools, least: float) -> Bools:
    """Ends of surfaces seen so flat that the next beam may hit the same one far behind."""
    n = len(points)
    index = np.arange(n)
    to_previous = np.append(False, joined[:-1])
    start = np.where(to_previous, np.maximum(index - 1, 0), np.minimum(index + 1, n - 1))
    along = points - points[start]
    beams = points - scan.spec.T_robot_laser[:2]
    cross = np.abs(along[:, 0] * beams[:, 1] - along[:, 1] * beams[:, 0])
    dot = np.abs((along * beams).sum(axis=1))
    flat: Bools = (to_previous ^ joined) & (cross < math.tan(least) * dot)
    return flat


def _draw(
    points: Float,
    ranges: Float,
    valid: Bools,
    joined: Bools,
    step: float,
) -> tuple[Float, Float, Float]:
    """The image, the width of its lines (cells), and the point (2,) m of its pixel (0, 0)."""
    origin = points[valid].min(axis=0) - MARGIN_CELLS * CELL_M
    width, height = (
        np.ceil((points[valid].max(axis=0) - origin) / CELL_M).astype(int) + MARGIN_CELLS
    ).tolist()
    image, widths = np.zeros((height, width)), np.ones((height, width))
    # Across the beam a point may lie anywhere within the beam's share of the circle.
    spread = np.sqrt(NOISE_M**2 + (np.maximum(ranges, 0.0) * step) ** 2 / 12.0) / CELL_M
    spread[~valid] = 1.0
    sigmas = np.maximum(spread, MIN_SIGMA_CELLS)
    draw(image, widths, (points - origin) / CELL_M, sigmas, valid, joined)
    return image, widths, origin


def _peaks(image: Float) -> list[tuple[int, int]]:
    """(column, row) of the local maxima of the smaller eigenvalue, the strongest first.

    OpenCV's response changes its last bits with the CPU; what is made of it, which pixel is the
    largest, does not but for ties.
    """
    response = cv2.cornerMinEigenVal(image.astype(np.float32), BLOCK, ksize=3)
    side = 2 * PEAK_CELLS + 1
    around = cv2.dilate(response, np.ones((side, side), np.uint8))
    rows, columns = np.nonzero((response >= around) & (response > RESPONSE * IDEAL))
    order = np.argsort(-response[rows, columns], kind="stable")
    return [(int(columns[k]), int(rows[k])) for k in order]


def _misleads(point: Float, beam: int, points: Float, false_ends: Bools) -> bool:
    """Nothing was measured there, or a false end was."""
    reach = WINDOW * CELL_M
    if ((points[beam] - point) ** 2).sum() > reach * reach:
        return True
    away = ((points[false_ends] - point) ** 2).sum(axis=1)
    return bool((away < reach * reach).any())


def _gap(beam: int, points: Float, joined: Bools, across_m: float) -> Float:
    """(2,) m along the surface to its next point, or across the beam where it has none."""
    before = points[beam] - points[beam - 1] if beam > 0 and joined[beam - 1] else None
    after = points[beam + 1] - points[beam] if joined[beam] else None
    gaps = [gap for gap in (before, after) if gap is not None]
    if not gaps:
        x, y = points[beam] / max(math.hypot(*points[beam]), 1e-9)
        return across_m * np.array([-y, x])
    return max(gaps, key=lambda gap: float((gap * gap).sum()))


def _covariance(cells: Float, gap: Float) -> Float:
    """Of the fit in the raster, of where in the gap between two beams it is, of what is round."""
    fit = cells * CELL_M**2
    own = (NOISE_M**2 + FLOOR_M**2) * np.eye(2)
    out: Float = fit + own + np.outer(gap, gap) / 3.0
    return out


def _features(scan: Scan, points: list[Float], covariances: list[Float]) -> Features:
    return Features(
        stamp_ns=scan.stamp_ns,
        points_robot=np.array(points).reshape(-1, 2),
        covariances=np.array(covariances).reshape(-1, 2, 2),
    )
