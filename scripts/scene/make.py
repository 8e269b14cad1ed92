# SPDX-License-Identifier: Apache-2.0
"""A scene from a map or from a log: three files, and what became of the map in words."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import imageio.v2 as imageio
import numpy as np
from numpy.typing import NDArray

import scenes
from scenes.from_map import FromMap, MapPlan, plan, write
from scenes.from_map.survey import raster_of
from scenes.kinds import KINDS, PUSHED
from scenes.plan import furniture
from scenes.scene import Scene
from scripts.whole_folder import check_place
from sim.driving.drive import TourConfig
from sim.driving.navgrid import NavGrid
from sim.view.mapview import MapView
from slam import create, se2
from slam.errors import InvalidValueError
from slam.estimate import Raster
from slam.files import replacing
from slam.frontend.seen_space import SeenSpace
from slam.logs.open import open_log
from slam.maps import read_map
from slam.rasters import trimmed
from slam.replay import Replay

CELL_M, MOST_CELLS = 0.05, 1 << 22
RIM_M = 0.5  # beyond the bounds: whoever gets there is out
NARROW_M = 0.1  # gaps that are narrower are not told
DOOR_M = 1.2  # from a hinge to a spot to visit
Picture = NDArray[np.uint8]
LONGEST_PX, MOST_PX_PER_M = 2400, 60.0
PAPER, UNKNOWN, CELL = (255, 255, 255), (225, 227, 230), (240, 150, 40)
WALL, THING, GOAL = (40, 50, 80), (20, 140, 90), (200, 30, 40)
START, GAP = (20, 90, 220), (200, 0, 160)
FLOORS = ((214, 230, 246), (214, 240, 224), (246, 234, 212), (236, 222, 244), (244, 220, 220))
COLUMNS, STEP_M = 7, 4.2
PX = 1400
FONT = cv2.FONT_HERSHEY_SIMPLEX


def problems(scene: Scene, robot_m: float = TourConfig().robot_radius_m) -> Iterator[str]:
    """Each a sentence that names the mark; none for a scene that is as it should be.

    robot_m  what the robot keeps clear about its axle
    """
    rooms = list(scene.rooms.values())
    inside = {
        name: any(a <= x <= c and b <= y <= d for a, b, c, d in rooms)
        for name, (x, y) in scene.goals.items()
    }
    grid = NavGrid(_wider(scene, 1.0), scene.obstacles, robot_m - 0.05)
    costs = grid.cost_to(np.array(scene.start[:2]))
    hinges = [scene.initial[m.name] for m in scene.movers if m.kind == "door"]
    for name, (x, y) in scene.goals.items():
        where = f"mark 'goal:{name}' at ({x:.2f}, {y:.2f})"
        if not inside[name]:
            yield f"{where} is in no room"
        if grid.lookup(costs, x, y) >= 1e6:
            yield f"{where} cannot be reached by the robot from its start"
        near = min((math.dist((x, y), hinge[:2]) for hinge in hinges), default=math.inf)
        if near < DOOR_M:
            yield f"{where} is {near:.2f} m from a hinge, expected at least {DOOR_M} m"
    if not scene.goals:
        yield "there is no mark 'goal:NAME': the robot has nowhere to drive to"
    x, y = scene.start[:2]
    if grid.lookup(grid.clearance, x, y) < grid.radius:
        yield f"mark 'start:robot' at ({x:.2f}, {y:.2f}) is too near to a wall or furniture"
    way_out = gap_to_nowhere(scene)
    if way_out is not None:
        wide, (u, v) = way_out
        yield f"the walls have a gap to nowhere: {wide:.1f} m wide, at ({u:.2f}, {v:.2f})"


def gap_to_nowhere(scene: Scene) -> tuple[float, tuple[float, float]] | None:
    """The widest way from the start out of the scene: how wide it is at its narrowest, and where.

    None where walls are all around. A door that stands before a gap shuts it.
    """
    x0, y0, x1, y1 = _wider(scene, RIM_M)
    cell_m = max(CELL_M, math.sqrt((x1 - x0) * (y1 - y0) / MOST_CELLS))
    shape = (math.ceil((y1 - y0) / cell_m), math.ceil((x1 - x0) / cell_m))
    leaves = [
        [*_middle(scene.initial[m.name], half), half, 0.03, scene.initial[m.name][2]]
        for m, half in ((m, 0.5 * m.radius) for m in scene.movers if m.group == "door")
    ]
    boxes = np.vstack([scene.obstacles.reshape(-1, 5), np.array(leaves).reshape(-1, 5)])
    walls = raster_of(boxes - [x0, y0, 0.0, 0.0, 0.0], shape, cell_m)
    # beyond the rim all is open, and counts as far from walls
    clear = cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    start = (int((scene.start[1] - y0) / cell_m), int((scene.start[0] - x0) / cell_m))
    low, high = 0.5 * NARROW_M / cell_m, float(clear[start])
    if not _leaves(clear > low, start):
        return None
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _leaves(clear > middle, start) else (low, middle)
    inner, edge = _part(clear > high, start), np.zeros(clear.shape, dtype=bool)
    edge[[0, -1]], edge[:, [0, -1]] = True, True
    wide = (clear > high).astype(np.uint8)
    _, labels = cv2.connectedComponents(wide, connectivity=4)
    outer = edge | np.isin(labels, np.unique(labels[edge & (wide > 0)]))
    away = [
        cv2.distanceTransform((~m).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for m in (inner, outer & ~inner)
    ]
    between = np.where(_part(clear > low, start), np.maximum(*away), np.inf)
    row, column = np.unravel_index(int(np.argmin(between)), clear.shape)
    return 2.0 * low * cell_m, (x0 + (column + 0.5) * cell_m, y0 + (row + 0.5) * cell_m)


def _part(free: NDArray[np.bool_], at: tuple[int, int]) -> NDArray[np.bool_]:
    _, labels = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    return np.asarray((labels == labels[at]) & free)


def _leaves(free: NDArray[np.bool_], at: tuple[int, int]) -> bool:
    """Whether the way from a cell leads to the edge of the picture."""
    if not free[at]:
        return False
    part = _part(free, at)
    return bool(part[0].any() or part[-1].any() or part[:, 0].any() or part[:, -1].any())


def _middle(pose: tuple[float, float, float], along: float) -> tuple[float, float]:
    return pose[0] + along * math.cos(pose[2]), pose[1] + along * math.sin(pose[2])


def _wider(scene: Scene, by: float) -> tuple[float, float, float, float]:
    a, b, c, d = scene.bounds
    return a - by, b - by, c + by, d + by


def contents(scene: Scene) -> Iterator[str]:
    """What stands and what moves, a line each."""
    a, b, c, d = scene.bounds
    area = sum((r[2] - r[0]) * (r[3] - r[1]) for r in scene.rooms.values())
    yield f"{c - a:.1f} x {d - b:.1f} m, {len(scene.rooms)} rectangles of floor with {area:.0f} m2"
    names = [geom.name for geom in scene.spec.geoms]
    first = Counter(name.partition(":")[0] for name in names if ":" in name)
    walls = {word: first[word] for word in ("wall", "parapet", "glass") if first[word]}
    yield "walls: " + (", ".join(f"{n} {word}" for word, n in walls.items()) or "none")
    bodies = [body.name.partition("/") for body in scene.spec.bodies if body.name.endswith("/base")]
    movers = {mover.name for mover in scene.movers}
    stands = Counter(name.rstrip("0123456789") for name, _, _ in bodies if name not in movers)
    yield "stands: " + (", ".join(f"{n} {kind}" for kind, n in sorted(stands.items())) or "nothing")
    kinds = Counter(mover.kind for mover in scene.movers)
    yield "moves: " + (", ".join(f"{n} {kind}" for kind, n in sorted(kinds.items())) or "nothing")
    goals = ", ".join(f"{name} ({x:.1f}, {y:.1f})" for name, (x, y) in scene.goals.items())
    yield f"spots to visit: {goals or 'none'}"


def over_map(map_: Raster, plan: MapPlan) -> Picture:
    """(height, width, 3) RGB: floor by room, occupied cells orange, walls dark over them."""
    x0, y0, x1, y1 = _extent(plan)
    scale = min(MOST_PX_PER_M, LONGEST_PX / max(x1 - x0, y1 - y0))
    width, height = max(32, round((x1 - x0) * scale)), max(32, round((y1 - y0) * scale))

    def px(points: object) -> NDArray[np.int32]:
        """Pixels of points (n, 2) m."""
        at = np.asarray(points, dtype=np.float64).reshape(-1, 2)
        return np.round((at * [1.0, -1.0] + [-x0, y1]) * scale).astype(np.int32)

    picture = np.full((height, width, 3), UNKNOWN, dtype=np.uint8)
    known, occupied = _sampled(map_, (x0, y1), scale, (height, width))
    picture[known] = PAPER
    for k, rects in enumerate(plan.rooms.values()):
        for a, b, c, d in rects:
            (left, low), (right, high) = px([[a, b], [c, d]]).tolist()
            cv2.rectangle(picture, (left, high), (right, low), FLOORS[k % len(FLOORS)], -1)
    for box in plan.walls:
        cv2.fillPoly(picture, [px(_corners(*box.tolist()))], WALL, cv2.LINE_AA)
    for thing in plan.things:
        for x, y, a, b, yaw in thing.parts:
            cv2.fillPoly(picture, [px(_corners(x, y, a + 0.02, b + 0.02, yaw))], THING)
    picture[occupied] = CELL
    for gap in plan.gaps:
        x, y, yaw = gap.at
        c, s = 0.5 * gap.wide_m * math.cos(yaw), 0.5 * gap.wide_m * math.sin(yaw)
        ends = px([[x - c, y - s], [x + c, y + s]]).tolist()
        cv2.line(picture, ends[0], ends[1], GAP, 3, cv2.LINE_AA)
    for goal in plan.goals:
        cv2.circle(picture, px(goal)[0].tolist(), 5, GOAL, -1, cv2.LINE_AA)
    cv2.circle(picture, px(plan.start[:2])[0].tolist(), 8, START, -1, cv2.LINE_AA)
    return picture


def _extent(plan: MapPlan) -> tuple[float, float, float, float]:
    """Around the rooms and every wall."""
    low, high = np.array(plan.bounds[:2]), np.array(plan.bounds[2:])
    if len(plan.walls):
        low = np.minimum(low, plan.walls[:, :2].min(axis=0) - 1.0)
        high = np.maximum(high, plan.walls[:, :2].max(axis=0) + 1.0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _sampled(
    map_: Raster, corner: tuple[float, float], scale: float, shape: tuple[int, int]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which pixels show what is known, and what is occupied."""
    rows, columns = np.nonzero(map_.values > 0.65)
    cells = (np.column_stack([columns, rows]) + 0.5) * map_.resolution_m
    at = se2.transform(map_.T_map_origin, cells)
    i = ((corner[1] - at[:, 1]) * scale).astype(int)
    j = ((at[:, 0] - corner[0]) * scale).astype(int)
    inside = (i >= 0) & (i < shape[0]) & (j >= 0) & (j < shape[1])
    occupied = np.zeros(shape, dtype=bool)
    occupied[i[inside], j[inside]] = True
    y, x = np.mgrid[: shape[0], : shape[1]]
    points = corner + np.column_stack([x.ravel() + 0.5, -0.5 - y.ravel()]) / scale
    back = np.floor(se2.transform(se2.inverse(map_.T_map_origin), points) / map_.resolution_m)
    at_cell = back.astype(int)
    height, width = map_.values.shape
    there = ((at_cell >= 0) & (at_cell < [width, height])).all(axis=1)
    known = np.zeros(len(points), dtype=bool)
    known[there] = np.isfinite(map_.values[at_cell[there, 1], at_cell[there, 0]])
    return known.reshape(shape), occupied


def _corners(x: float, y: float, a: float, b: float, yaw: float) -> list[tuple[float, float]]:
    c, s = math.cos(yaw), math.sin(yaw)
    return [(x + u * a * c - v * b * s, y + u * a * s + v * b * c)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]  # fmt: skip


def kinds() -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of what stands and of what can be pushed, which ``put`` takes."""
    return furniture(), tuple(k for k, row in KINDS.items() if row.group in PUSHED)


def picture() -> Picture:
    """(height, width, 3) RGB, from above."""
    names = sorted(sum(kinds(), ()))
    rows = -(-len(names) // COLUMNS)
    spots = {
        name: ((k % COLUMNS + 0.5) * STEP_M, (rows - k // COLUMNS - 0.5) * STEP_M)
        for k, name in enumerate(names)
    }
    wide, high = COLUMNS * STEP_M, rows * STEP_M
    put = "\n".join(f'  ["{name}", {x:.2f}, {y + 0.3:.2f}, 0],' for name, (x, y) in spots.items())
    outline = f"[[0, -2], [{wide}, -2], [{wide}, {high}], [0, {high}], [0, -2]]"
    with TemporaryDirectory() as folder:
        file = Path(folder) / "kinds.toml"
        told = f"walls = [{outline}]\nstart = [1, -1, 0]\nseats = false\nput = [\n{put}\n]\n"
        file.write_text(told, encoding="utf-8")
        scene = scenes.build(str(file))
    view = MapView(scene, PX, round(PX * (high + 3.2) / (wide + 1.2)))
    drawn = view.draw([scene.initial[mover.name] for mover in scene.movers])
    for name, (x, y) in spots.items():
        (width, _), _ = cv2.getTextSize(name, FONT, 0.48, 1)
        at = view.to_pixels(np.array([[x, y - 0.46 * STEP_M]]))[0]
        place = (round(at[0] - 0.5 * width), round(at[1]))
        cv2.putText(drawn, name, place, FONT, 0.48, (40, 44, 54), 1, cv2.LINE_AA)
    return drawn[: round(view.to_pixels(np.array([[0.0, -0.3]]))[0][1])]


MOST_PIXELS = 36_000_000  # of a map, 300 m square at 5 cm; to refuse such a one takes 1 GB
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
    robot: str = "",
    overwrite: bool = False,
) -> Made:
    """Write STEM.toml, STEM.xml and STEM.png.

    Raises ``InvalidValueError`` as ``scenes.from_map.plan``, and as ``check_place``.
    """
    *others, picture = (stem.with_name(stem.name + end) for end in (".toml", ".xml", ".png"))
    check_place(*others, picture, overwrite=overwrite)
    drawn = plan(map_, options, source=source)
    stem.parent.mkdir(parents=True, exist_ok=True)
    with replacing(picture) as new:
        imageio.imwrite(new, over_map(map_, drawn), format="png")
    toml = write(drawn, stem, furniture=furniture, doors=doors, made_of=source, robot=robot)
    return Made(files=(toml, toml.with_suffix(".xml"), picture), plan=drawn)


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
        f"floor: {f.floor_m2:.0f} m2 that the robot can reach; {len(drawn.rooms)} rooms with "
        f"{f.rooms_m2:.0f} m2 in rectangles, {len(drawn.goals)} spots to visit"
    )
    yield f"things that can move: {len(drawn.things)}; gaps offered as doors: {len(drawn.gaps)}"
