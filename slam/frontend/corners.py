# SPDX-License-Identifier: Apache-2.0
"""General-purpose point features of a scan (Li and Olson 2010): corners, ends, thin posts.

The scan becomes an image in which every point is as wide as it is uncertain, and the corner
detector of image processing (Kanade and Tomasi: the smaller eigenvalue of the gradients' second
moments) finds whatever can be located in two directions, without a model of what it is. What only
looks like an end is left out: the edge of a shadow that something nearer throws, the limit of the
field of view, and mixed pixels, whose beam hit two surfaces and measured neither.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from slam.frames import Features, Float, Scan
from slam.frontend import corner_image
from slam.frontend.corner_config import CornerConfig
from slam.frontend.deskew import end_points

FAR_M = 1e6  # stands for no return


CORNERS = CornerConfig()


def corners(
    scan: Scan, *, twist: Float | None = None, config: CornerConfig | None = None
) -> Features:
    """Corners of ``scan`` in the robot frame at its stamp, de-skewed with the body ``twist``."""
    config = config or CORNERS
    points = _points(scan, twist)
    ranges = answered(scan, config.failed)
    step = scan.spec.angle_increment
    grazing = math.radians(config.grazing_deg)
    joined = corner_image.joined_beams(ranges, scan.valid, points, step, grazing, config.noise_m)
    valid, false_ends = _judge_ends(ranges, scan.valid, joined)
    false_ends |= valid & _flat(points, scan, joined, math.radians(config.flat_deg))
    near = ranges <= config.range_m
    false_ends |= valid & near & _beside(joined, ~near)  # only the limit of drawing
    valid, false_ends = valid & near, false_ends & near
    if not valid.any():
        return _features(scan, [], [])
    image, widths, origin = _draw(points, ranges, valid, joined, step, config)
    found, covariances = [], []
    for column, row in _peaks(image, config):
        x, y, cells, ok = corner_image.refine(image, widths, column, row, config.window)
        point = origin + config.cell_m * np.array([x, y])
        beam = _nearest(point, points, valid)
        if not ok or _misleads(point, beam, points, false_ends, config):
            continue
        found.append(point)
        gap = _gap(beam, points, joined, ranges[beam] * step)
        covariances.append(_covariance(cells, gap, config))
    return _features(scan, found, covariances)


def answered(scan: Scan, most_failed: int = CORNERS.failed) -> Float:
    """(n,) m: ranges; ``FAR_M`` where nothing is, -1 where a beam failed."""
    failed = np.isnan(scan.ranges)
    ranges = np.where(failed, -1.0, np.minimum(scan.ranges, FAR_M, dtype=np.float64))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], failed, [False]])))
    for first, past in edges.reshape(-1, 2).tolist():
        if past - first > most_failed:
            ranges[first:past] = FAR_M
    return ranges


def _points(scan: Scan, twist: Float | None) -> Float:
    """(n, 2) end points in the robot frame at the stamp; what has no range lies at the laser."""
    spec = scan.spec
    ranges = np.where(scan.valid, scan.ranges, 0.0).astype(np.float64)
    still = np.zeros(3) if twist is None else np.asarray(twist, dtype=np.float64)
    return end_points(ranges, spec.angles, spec.beam_time_offsets, spec.T_robot_laser, still)


def _judge_ends(
    ranges: Float, valid: NDArray[np.bool_], joined: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
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


def _beside(joined: NDArray[np.bool_], these: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Points joined to one of ``these``."""
    out: NDArray[np.bool_] = joined & np.append(these[1:], False)
    out[1:] |= joined[:-1] & these[:-1]
    return out


def _flat(points: Float, scan: Scan, joined: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Ends of surfaces seen so flat that the next beam may hit the same one far behind."""
    n = len(points)
    index = np.arange(n)
    to_previous = np.append(False, joined[:-1])
    start = np.where(to_previous, np.maximum(index - 1, 0), np.minimum(index + 1, n - 1))
    along = points - points[start]
    beams = points - scan.spec.T_robot_laser[:2]
    cross = np.abs(along[:, 0] * beams[:, 1] - along[:, 1] * beams[:, 0])
    dot = np.abs((along * beams).sum(axis=1))
    flat: NDArray[np.bool_] = (to_previous ^ joined) & (cross < math.tan(least) * dot)
    return flat


def _draw(
    points: Float,
    ranges: Float,
    valid: NDArray[np.bool_],
    joined: NDArray[np.bool_],
    step: float,
    config: CornerConfig,
) -> tuple[Float, Float, Float]:
    """The image, the width of its lines (cells), and the point (2,) m of its pixel (0, 0)."""
    cell = config.cell_m
    origin = points[valid].min(axis=0) - config.margin_cells * cell
    width, height = (
        np.ceil((points[valid].max(axis=0) - origin) / cell).astype(int) + config.margin_cells
    ).tolist()
    image, widths = np.zeros((height, width)), np.ones((height, width))
    # Across the beam a point may lie anywhere within the beam's share of the circle.
    spread = np.sqrt(config.noise_m**2 + (np.maximum(ranges, 0.0) * step) ** 2 / 12.0) / cell
    spread[~valid] = 1.0
    sigmas = np.maximum(spread, config.min_sigma_cells)
    corner_image.draw(image, widths, (points - origin) / cell, sigmas, valid, joined)
    return image, widths, origin


def _peaks(image: Float, config: CornerConfig) -> list[tuple[int, int]]:
    """(column, row) of the local maxima of the smaller eigenvalue, the strongest first.

    OpenCV's response changes its last bits with the CPU; what is made of it, which pixel is the
    largest, does not but for ties.
    """
    response = cv2.cornerMinEigenVal(image.astype(np.float32), config.block, ksize=3)
    side = 2 * config.peak_cells + 1
    around = cv2.dilate(response, np.ones((side, side), np.uint8))
    rows, columns = np.nonzero((response >= around) & (response > config.response * config.ideal))
    order = np.argsort(-response[rows, columns], kind="stable")
    return [(int(columns[k]), int(rows[k])) for k in order]


def _nearest(point: Float, points: Float, valid: NDArray[np.bool_]) -> int:
    away = np.where(valid, ((points - point) ** 2).sum(axis=1), np.inf)
    return int(away.argmin())


def _misleads(
    point: Float, beam: int, points: Float, false_ends: NDArray[np.bool_], config: CornerConfig
) -> bool:
    """Nothing was measured there, or a false end was."""
    reach = config.window * config.cell_m
    if ((points[beam] - point) ** 2).sum() > reach * reach:
        return True
    away = ((points[false_ends] - point) ** 2).sum(axis=1)
    return bool((away < reach * reach).any())


def _gap(beam: int, points: Float, joined: NDArray[np.bool_], across_m: float) -> Float:
    """(2,) m along the surface to its next point, or across the beam where it has none."""
    before = points[beam] - points[beam - 1] if beam > 0 and joined[beam - 1] else None
    after = points[beam + 1] - points[beam] if joined[beam] else None
    gaps = [gap for gap in (before, after) if gap is not None]
    if not gaps:
        x, y = points[beam] / max(math.hypot(*points[beam]), 1e-9)
        return across_m * np.array([-y, x])
    return max(gaps, key=lambda gap: float((gap * gap).sum()))


def _covariance(cells: Float, gap: Float, config: CornerConfig) -> Float:
    """Of the fit in the raster, of where in the gap between two beams it is, of what is round."""
    fit = cells * config.cell_m**2
    own = (config.noise_m**2 + config.floor_m**2) * np.eye(2)
    out: Float = fit + own + np.outer(gap, gap) / 3.0
    return out


def _features(scan: Scan, points: list[Float], covariances: list[Float]) -> Features:
    return Features(
        stamp_ns=scan.stamp_ns,
        points_robot=np.array(points).reshape(-1, 2),
        covariances=np.array(covariances).reshape(-1, 2, 2),
    )
