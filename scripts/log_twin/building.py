# SPDX-License-Identifier: Apache-2.0
"""The building of a log as a scene: the plan of its cells, walls moved to where its returns lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from scenes.from_map import FromMap, plan, write
from sim.twins.faces import laid
from slam import se2
from slam.evaluation.evidence import evidence_of
from slam.frames import Float, Frame

PASSES = 2  # the second time with better poses


def written_building(
    frames: Sequence[Frame], poses: Float, stem: Path, log: str
) -> tuple[Path, Float]:
    """Write the scene of what scans at ``poses`` show, as STEM.toml and STEM.xml.

    Returns the former and the poses (n, 3), put right by its walls.
    """
    scans = [frame.scan for frame in frames if frame.scan is not None]
    mount, angles = scans[0].spec.T_robot_laser, scans[0].spec.angles
    ranges = np.array([np.where(scan.valid, scan.ranges, np.nan) for scan in scans])
    for _ in range(PASSES):
        raster = evidence_of(scans, poses).raster()
        drawn = plan(raster, FromMap(path=poses[:, :2], things=False, few=False), source=log)
        lasers = np.array([se2.compose(pose, mount) for pose in poses])
        walls, lasers = laid(drawn.walls, lasers, ranges.astype(np.float64), angles)
        poses = np.array([se2.compose(laser, se2.inverse(mount)) for laser in lasers])
    return write(replace(drawn, walls=walls), stem, made_of=log), poses
