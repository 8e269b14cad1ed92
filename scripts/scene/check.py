# SPDX-License-Identifier: Apache-2.0
"""What is wrong with a scene, by the names of its marks, before anything runs in it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from scenes.from_map.survey import raster_of
from scenes.scene import Scene
from sim.driving.drive import TourConfig
from sim.driving.navgrid import NavGrid

CELL_M = 0.05
RIM_M = 0.5  # beyond the bounds: whoever gets there is out
NARROW_M = 0.1  # gaps that are narrower are not told
DOOR_M = 1.2  # from a hinge to a spot to visit


def problems(scene: Scene) -> Iterator[str]:
    """Each a sentence that names the mark; none for a scene that is as it should be."""
    rooms = list(scene.rooms.values())
    inside = {
        name: any(a <= x <= c and b <= y <= d for a, b, c, d in rooms)
        for name, (x, y) in scene.goals.items()
    }
    grid = NavGrid(_wider(scene, 1.0), scene.obstacles, TourConfig().robot_radius_m - 0.05)
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
    shape = (math.ceil((y1 - y0) / CELL_M), math.ceil((x1 - x0) / CELL_M))
    leaves = [
        [*_middle(scene.initial[m.name], 0.5 * m.radius), 0.5 * m.radius, 0.03, scene.initial[m.name][2]]
        for m in scene.movers
        if m.group == "door"
    ]
    boxes = np.vstack([scene.obstacles.reshape(-1, 5), np.array(leaves).reshape(-1, 5)])
    walls = raster_of(boxes - [x0, y0, 0.0, 0.0, 0.0], shape, CELL_M)
    # beyond the rim all is open, and counts as far from walls
    clear = cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    start = (int((scene.start[1] - y0) / CELL_M), int((scene.start[0] - x0) / CELL_M))
    low, high = 0.5 * NARROW_M / CELL_M, float(clear[start])
    if not _leaves(clear > low, start):
        return None
    for _ in range(12):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _leaves(clear > middle, start) else (low, middle)
    inner = _part(clear > high, start)
    near = cv2.distanceTransform((~inner).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    neck = _part(clear > low, start) & ~inner & (clear <= high + 1.0)
    if not neck.any():
        return 2.0 * low * CELL_M, (scene.start[0], scene.start[1])
    row, column = np.unravel_index(int(np.argmin(np.where(neck, near, np.inf))), near.shape)
    return 2.0 * low * CELL_M, (x0 + (column + 0.5) * CELL_M, y0 + (row + 0.5) * CELL_M)


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
