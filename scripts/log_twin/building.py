# SPDX-License-Identifier: Apache-2.0
"""The building of a log as a plan: walls of its cells, moved to where its returns lie."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scenes.from_map.walls import boxes_of
from sim.twins.faces import moved_to
from slam import se2
from slam.evaluation.evidence import evidence_of
from slam.files import write_text
from slam.frames import Float, Frame

TOLERANCE_M = 0.05  # to which walls are straightened
MARGIN_M = 2.0  # of floor beyond the walls
HALF_HEIGHT_M = 0.55


def written_building(frames: Sequence[Frame], poses: Float, path: Path) -> Path:
    """Write the plan of what scans at ``poses`` show; ``path``."""
    scans = [frame.scan for frame in frames if frame.scan is not None]
    raster = evidence_of(scans, poses).raster()
    x0, y0, _ = raster.T_map_origin.tolist()
    boxes = boxes_of(raster.values == 1.0, raster.resolution_m, TOLERANCE_M)
    boxes = boxes + np.array([x0, y0, 0.0, 0.0, 0.0])
    lasers = np.array([se2.compose(pose, scans[0].spec.T_robot_laser) for pose in poses])
    ranges = np.array([np.where(scan.valid, scan.ranges, np.nan) for scan in scans])
    boxes = moved_to(boxes, lasers, ranges.astype(np.float64), scans[0].spec.angles)
    write_text(path, _plan(boxes, poses))
    return path


def _plan(boxes: Float, poses: Float) -> str:
    reach = np.hypot(boxes[:, 2], boxes[:, 3])[:, None]
    low = (boxes[:, :2] - reach).min(axis=0) - MARGIN_M
    high = (boxes[:, :2] + reach).max(axis=0) + MARGIN_M
    (cx, cy), (hx, hy) = (0.5 * (low + high)).round(3), (0.5 * (high - low)).round(3)
    floor = f'pos="{cx} {cy} 0" size="{hx} {hy} 0.1"'
    lines = ["<mujoco><worldbody>"]
    lines.append(f'<geom name="floor:all" class="floor" {floor} material="floor_concrete"/>')
    for k, (x, y, a, b, yaw) in enumerate(boxes.tolist()):
        place = f'pos="{x:g} {y:g} {HALF_HEIGHT_M}" euler="0 0 {yaw:g}"'
        size = f'size="{a:g} {b:g} {HALF_HEIGHT_M}"'
        lines.append(f'<geom name="wall:{k}" class="wall" {place} {size}/>')
    lines.append(f'<site name="room:all" type="box" pos="{cx} {cy} 0" size="{hx} {hy} 0.01"/>')
    for name, (x, y, yaw) in (("start:robot", poses[0]), ("goal:end", poses[-1])):
        lines.append(f'<site name="{name}" pos="{x:.3f} {y:.3f} 0" euler="0 0 {yaw:.4f}"/>')
    return "\n".join([*lines, "</worldbody></mujoco>", ""])
