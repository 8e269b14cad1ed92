# SPDX-License-Identifier: Apache-2.0
"""A scene from a map or from a log: three files, and what became of the map in words."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
from numpy.typing import NDArray

from scenes.from_map import FromMap, MapPlan, plan, write
from scenes.from_map.floor import Passage
from scenes.from_map.plan import OCCUPIED
from scenes.scene import Scene
from scripts.scene.check import LEAST_M2, problems
from scripts.scene.picture import picture, stands
from scripts.whole_folder import check_place
from sim.driving.pilot import tour_of
from sim.simulation import Simulation
from slam import create, se2
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.files import replacing
from slam.frames import Float
from slam.frontend.seen_space import SeenSpace
from slam.logs.open import open_log
from slam.maps import read_map
from slam.rasters import trimmed
from slam.replay import Replay

MOST_PIXELS = 36_000_000  # of a map, 300 m square at 5 cm; to refuse such a one takes 1 GB
SWEEPS = 4000  # scans of a log, at most, by which it is known what floor is free


@dataclass(frozen=True, kw_only=True)
class Made:
    """The files of a scene, its plan, and how it starts."""

    files: tuple[Path, ...]
    plan: MapPlan
    seen: "Seen"

    def problems(self) -> Iterator[str]:
        """What is wrong with the scene, and what of the map is not in it."""
        yield from self.seen.problems()
        area, (x, y) = self.plan.figures.shut_off
        if area >= LEAST_M2:
            yield (
                f"{area:.0f} m2 of floor about ({x:.1f}, {y:.1f}) cannot be reached from the "
                "start: the scene leaves it out"
            )


class Seen:
    """A scene by its name, with its robot, as it starts. Raises what ``run`` would."""

    def __init__(self, which: str, seed: int = 0) -> None:
        self._which, simulation = which, Simulation(which, seed=seed, dynamism=0.0, crowd="none")
        simulation.observe()
        self._world = simulation.world
        self.scene: Scene = self._world.scene

    def picture(self, path: Path, cells: Float | None = None, gaps: tuple[Float, ...] = ()) -> Path:
        """Write it as it starts; ``cells`` and ``gaps`` as ``scripts.scene.picture`` has them."""
        with replacing(path) as new:
            drawn = picture(self.scene, self._world.mover_poses(), cells, gaps)
            imageio.imwrite(new, drawn, format="png")
        return path

    def problems(self) -> list[str]:
        """What is wrong with it, a sentence each."""
        robot_m = tour_of(self._world.robot).robot_radius_m
        return list(problems(self.scene, robot_m, self._which))


def contents(scene: Scene) -> Iterator[str]:
    """What stands and what can move, a line each."""
    a, b, c, d = scene.bounds
    area = sum((r[2] - r[0]) * (r[3] - r[1]) for r in scene.rooms.values())
    yield f"{c - a:.1f} x {d - b:.1f} m, {len(scene.rooms)} rectangles of floor with {area:.0f} m2"
    names = [geom.name for geom in scene.spec.geoms if not geom.name.startswith("wall:thing")]
    first = Counter(name.partition(":")[0] for name in names)
    walls = Counter({word: first[word] for word in ("wall", "parapet", "glass")})
    yield f"walls: {_counts(walls)}"
    yield f"stands: {_counts(stands(scene))}"
    yield f"can move: {_counts(scene.can_move)}"
    goals = ", ".join(f"{name} ({x:.1f}, {y:.1f})" for name, (x, y) in scene.goals.items())
    yield f"spots to visit: {goals or 'none'}"


def _counts(counts: Counter[str]) -> str:
    each = ", ".join(f"{n} {kind}" for kind, n in sorted((+counts).items()))
    return f"{counts.total()} ({each})" if len(+counts) > 1 else each or "nothing"


def made(  # noqa: PLR0913 (by keyword)
    map_: Raster,
    options: FromMap,
    stem: Path,
    *,
    source: str,
    furniture: str = "move",
    doors: str = "open",
    robot: str = "",
    overwrite: bool = False,
) -> Made:
    """Write STEM.toml, STEM.xml and STEM.png.

    Raises ``InvalidValueError`` as ``scenes.from_map.plan``, and as ``check_place``.
    """
    *others, image = (stem.with_name(stem.name + end) for end in (".toml", ".xml", ".png"))
    check_place(*others, image, overwrite=overwrite)
    drawn = plan(map_, options, source=source)
    stem.parent.mkdir(parents=True, exist_ok=True)
    toml = write(drawn, stem, furniture=furniture, doors=doors, made_of=source, robot=robot)
    seen = Seen(str(toml))
    rows, columns = np.nonzero(map_.values > OCCUPIED)
    cells = (np.column_stack([columns, rows]) + 0.5) * map_.resolution_m
    gaps = () if doors != "none" else tuple(map(_ends, drawn.gaps))
    seen.picture(image, se2.transform(map_.T_map_origin, cells), gaps)
    return Made(files=(toml, toml.with_suffix(".xml"), image), plan=drawn, seen=seen)


def _ends(gap: Passage) -> Float:
    """(2, 2) m."""
    half = 0.5 * gap.wide_m
    ends: Float = se2.transform(np.array(gap.at), np.array([[-half, 0.0], [half, 0.0]]))
    return ends


def of_file(path: Path) -> Raster:
    """The map of a map_server; raises as ``slam.maps.read_map``."""
    return read_map(path, saved=True, most_pixels=MOST_PIXELS)


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
        f"floor: {f.floor_m2:.0f} m2 for the robot's middle; {len(drawn.rooms)} rooms with "
        f"{f.rooms_m2:.0f} m2 in rectangles, {len(drawn.goals)} spots to visit"
    )
    yield (
        f"small things of the map: {len(drawn.things)}; gaps offered as doors: {len(drawn.gaps)}; "
        f"walls where the map ends: {2.0 * float(drawn.ends[:, 2].sum()):.0f} m"
    )
