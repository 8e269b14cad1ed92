# SPDX-License-Identifier: Apache-2.0
"""A scan as all pictures draw it: where beams ended, coloured by what they hit."""

import numpy as np
from numpy.typing import NDArray

from sim.view import draw
from sim.view.draw import Color
from slam.frames import BeamClass, Float, Frame, Scan

LEGEND: tuple[tuple[str, Color], ...] = (
    ("static", draw.AZURE),
    ("semi-static", draw.TEAL),
    ("moving", draw.MAGENTA),
    ("mixed pixel", draw.VIOLET),
    ("no return", draw.GRAY),
)
_BY_KIND = {
    BeamClass.STATIC: draw.AZURE,
    BeamClass.SEMI_STATIC: draw.TEAL,
    BeamClass.MOVING: draw.MAGENTA,
}
FAN: Color = (96, 168, 255)  # what a scan sweeps over, see-through
SILENT_M = 1.2  # how long a beam without return is drawn


def beam_colors(frame: Frame) -> NDArray[np.uint8]:
    """(n_beams, 3) RGB by what each beam hit; the colour of raw LIDAR where nothing says."""
    assert frame.scan is not None
    colors = np.empty((frame.scan.spec.n_beams, 3), np.uint8)
    colors[:] = draw.BLUE
    if frame.labels is not None:
        for kind, color in _BY_KIND.items():
            colors[frame.labels.kind == kind] = color
        colors[frame.labels.mixed] = draw.VIOLET
    colors[~frame.scan.valid] = draw.GRAY
    return colors


def beam_ends(scan: Scan) -> Float:
    """(n_beams, 2) m in the laser frame, NaN without a return (not de-skewed)."""
    ranges = np.where(scan.valid, scan.ranges.astype(np.float64), np.nan)
    angles = scan.spec.angles
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)


def silent_ends(scan: Scan) -> Float:
    """(k, 2) m in the laser frame: where the marks of beams without a return are."""
    angles = scan.spec.angles[~scan.valid]
    return SILENT_M * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def beams(frame: Frame) -> tuple[Float, Float, NDArray[np.uint8]]:
    """Where the scanner is on the robot, (n, 2) m in its frame of where beams ended, and (n, 3) RGB
    by what they hit; the features of a log without scans."""
    if frame.scan is None:
        xy = np.zeros((0, 2)) if frame.features is None else frame.features.points_robot
        return np.zeros(3), xy, np.full((len(xy), 3), 40, np.uint8)
    valid = frame.scan.valid
    return frame.scan.spec.T_robot_laser, beam_ends(frame.scan)[valid], beam_colors(frame)[valid]
