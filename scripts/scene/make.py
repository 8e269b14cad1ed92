# SPDX-License-Identifier: Apache-2.0
"""A scene from a map or from a log: three files, and what became of the map in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
from numpy.typing import NDArray

from scenes.from_map import FromMap, MapPlan, plan, write
from scripts.scene.picture import over_map
from slam import create
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.files import replacing
from slam.frontend.seen_space import SeenSpace
from slam.logs.open import open_log
from slam.maps import read_map
from slam.rasters import trimmed
from slam.replay import Replay

SWEEPS = 4000  # scans of a log, at most, by which it is known what floor is free


@dataclass(frozen=True, kw_only=True)
class Made:
    """The files of a scene and its plan."""

    files: tuple[Path, ...]
    plan: MapPlan


def made(  # noqa: PLR0913 (by keyword)
    map_: Raster,
    options: FromMap,
    stem: Path,
    *,
    source: str,
    furniture: str = "move",
    doors: str = "open",
    overwrite: bool = False,
) -> Made:
    """Write STEM.toml, STEM.xml and STEM.png.

    Raises ``InvalidValueError`` as ``scenes.from_map.plan``, and for files that are there already.
    """
    picture = stem.with_name(stem.name + ".png")
    for file in (stem.with_name(stem.name + ".toml"), stem.with_name(stem.name + ".xml"), picture):
        if file.exists() and not overwrite:
            raise InvalidValueError(f"{file} is there already: --overwrite replaces it")
    drawn = plan(map_, options, source=source)
    stem.parent.mkdir(parents=True, exist_ok=True)
    with replacing(picture) as new:
        imageio.imwrite(new, over_map(map_, drawn), format="png")
    toml = write(drawn, stem, furniture=furniture, doors=doors, made_of=source)
    return Made(files=(toml, toml.with_suffix(".xml"), picture), plan=drawn)


def of_file(path: Path) -> Raster:
    """The map of a map_server; raises as ``slam.maps.read_map``."""
    return read_map(path, saved=True)


def of_log(path: Path, slam: str, *, strict: bool) -> tuple[Raster, NDArray[np.float64]]:
    """The map that a SLAM makes of a log, and the robot's poses (n, 3) in it.

    Raises ``InvalidValueError`` for a SLAM without a map of cells, and as the readers of logs do.
    """
    stream = open_log(path, strict=strict)
    replay = Replay.of({slam: create(slam)})
    track = replay.tracks[slam]
    every = max(1, (stream.length or SWEEPS) // SWEEPS)
    scans = [
        (k, frame.scan)
        for k, frame in enumerate(replay.run(stream))
        if frame.scan is not None and k % every == 0
    ]
    track.finish()
    poses = np.array([estimate.T_map_robot for estimate in track.estimates])
    final = track.final()
    poses = poses if final is None else final.poses
    cells = track.map()
    if cells is None or not len(poses):
        raise InvalidValueError(f"{path.name}: '{slam}' makes no map of cells of it")
    seen = SeenSpace()
    for k, scan in scans:
        seen.add(scan, poses[min(k, len(poses) - 1)])
    return seen.merge(trimmed(cells) or cells), poses


def in_words(drawn: MapPlan) -> Iterator[str]:
    """What became of the map, a line each."""
    f = drawn.figures
    yield (
        f"walls: {f.walls} boxes of 0.3 m or more and {f.pieces} shorter pieces, {f.wall_m:.0f} m "
        f"in all ({(f.walls + f.pieces) / max(f.wall_m, 1e-9):.2f} a metre)"
    )
    yield (
        f"of the map's occupied cells {100 * f.cells_near:.1f} % lie within 5 cm of what was "
        f"built; of the walls' faces {100 * f.walls_near:.1f} % within 5 cm of an occupied cell"
    )
    yield (
        f"floor: {f.floor_m2:.0f} m2 that the robot can reach; {len(drawn.rooms)} rooms with "
        f"{f.rooms_m2:.0f} m2 in rectangles, {len(drawn.goals)} spots to visit"
    )
    yield f"things that can move: {len(drawn.things)}; gaps offered as doors: {len(drawn.gaps)}"
