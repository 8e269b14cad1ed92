# SPDX-License-Identifier: Apache-2.0
"""A picture of a world from above, drawn by OpenCV: no GL, a few milliseconds.

    view = MapView(scene, 1280, 720)
    picture = view.draw(world.mover_poses(), scan=(T_world_laser, points_world))

The floor plan is painted once from the scene's own geoms; movers, scan and trails on top of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenes.kinds import kind_of
from scenes.scene import Scene
from sim.view import icons
from sim.view.floorplan import PAD, SHIFT, FloorPlan, fixed, panel, text_width, write
from slam.errors import InvalidValueError

Float = NDArray[np.float64]
Picture = NDArray[np.uint8]

SCAN_FILL = (255, 190, 120)
LABEL_FILL = (96, 168, 255)  # under hits that have colours of their own
SCAN_SHARE = 0.34
SCAN_HIT = (214, 64, 24)
TRAILS = {
    "truth": (40, 44, 54),
    "odometry": (214, 128, 36),
    "shunting": (28, 108, 214),
}
OTHER_TRAILS = ((146, 64, 190), (24, 150, 110), (200, 50, 110))
MAX_TRAIL_POINTS = 500


class MapView:
    """Draws one scene; ``width`` and ``height`` in px."""

    def __init__(self, scene: Scene, width: int, height: int) -> None:
        if not (32 <= width <= 8192 and 32 <= height <= 8192):
            raise InvalidValueError(f"a map must be 32..8192 px each way, got {width}x{height}")
        self.plan = FloorPlan(scene, width, height)
        self._n_movers = len(scene.movers)
        self._strokes = _strokes(scene)
        self._people = [k for k, m in enumerate(scene.movers) if m.kind == "person"]

    def to_pixels(self, points_world: ArrayLike) -> Float:
        """(n, 2) px (column, row), fractional, of points (n, 2) m."""
        return self.plan.to_pixels(np.asarray(points_world, dtype=np.float64))

    def draw(
        self,
        poses: ArrayLike,
        *,
        feet: ArrayLike | None = None,
        scan: tuple[ArrayLike, ArrayLike] | None = None,
        colours: NDArray[np.uint8] | None = None,
        trails: Mapping[str, ArrayLike] | None = None,
        caption: str = "",
    ) -> Picture:
        """A fresh (height, width, 3) RGB picture.

        poses    (n, 3) world poses of ``scene.movers`` in that order; a door's is its hinge and the
                 direction of its leaf. Rows with NaN are not drawn
        feet     optional (n_people, 2, 3) world poses of the ankles, left and right
        scan     optional pose of the laser (3,) and hits (k, 2) m in beam order; NaN: no return
        colours  optional (k, 3) RGB of the hits
        trails   optional paths (k, 2) m by name, drawn in this order with a legend
        caption  text in the lower right corner

        Raises ``InvalidValueError`` when the number of poses is not that of the movers.
        """
        places = np.asarray(poses, dtype=np.float64)
        if places.shape != (self._n_movers, 3):
            raise InvalidValueError(
                f"poses must have shape ({self._n_movers}, 3), got {places.shape}"
            )
        picture: Picture = self.plan.picture.copy()
        if scan is not None:
            self._draw_fan(picture, *scan, SCAN_FILL if colours is None else LABEL_FILL)
        for name, path in (trails or {}).items():
            self._draw_trail(picture, np.asarray(path, dtype=np.float64), _trail_colour(name))
        self._draw_movers(picture, places, feet)
        if scan is not None:
            self._draw_hits(picture, scan[1], colours)
        self._write(picture, list(trails or {}), caption)
        return picture

    # -- parts of the picture -----------------------------------------------------------------

    def _draw_movers(self, picture: Picture, poses: Float, feet: ArrayLike | None) -> None:
        if feet is None:
            ankles = np.array([_ankles(pose) for pose in poses[self._people]])
        else:
            ankles = np.asarray(feet, dtype=np.float64)
        strokes = self._strokes
        owners = np.vstack([poses, ankles.reshape(-1, 3)])[strokes.owner]
        cos = np.array([math.cos(yaw) for yaw in owners[:, 2].tolist()])[strokes.of_point]
        sin = np.array([math.sin(yaw) for yaw in owners[:, 2].tolist()])[strokes.of_point]
        x, y = strokes.points[:, 0], strokes.points[:, 1]
        places = owners[strokes.of_point, :2]
        turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1) + places
        drawn = np.isfinite(owners).all(axis=1)
        pixels = fixed(self.plan.to_pixels(np.nan_to_num(turned)))
        for index in np.flatnonzero(drawn).tolist():
            shape = strokes.shapes[index]
            lines = [pixels[start:end] for start, end in strokes.spans[index]]
            if shape.width:
                thick = max(1, round(shape.width * self.plan.scale))
                cv2.polylines(picture, lines, shape.closed, shape.colour, thick, cv2.LINE_AA, SHIFT)
                continue
            for line in lines:
                cv2.fillConvexPoly(picture, line, shape.colour, cv2.LINE_AA, SHIFT)

    def _draw_fan(
        self, picture: Picture, T_world_laser: ArrayLike, points: ArrayLike, fill: icons.Colour
    ) -> None:
        """The swept area, see-through."""
        hits = np.asarray(points, dtype=np.float64)
        hits = hits[np.isfinite(hits).all(axis=1)]
        if len(hits) < 2:
            return
        origin = np.asarray(T_world_laser, dtype=np.float64)[:2]
        outline = self.plan.to_pixels(np.vstack([origin, hits]))
        low = np.maximum(np.floor(outline.min(axis=0)).astype(int) - 1, 0)
        high = np.ceil(outline.max(axis=0)).astype(int) + 2
        window = picture[low[1] : high[1], low[0] : high[0]]
        if not window.size:
            return
        tinted = window.copy()
        cv2.fillPoly(tinted, [fixed(outline - low)], fill, cv2.LINE_AA, SHIFT)
        cv2.addWeighted(tinted, SCAN_SHARE, window, 1.0 - SCAN_SHARE, 0.0, dst=window)

    def _draw_hits(
        self, picture: Picture, points: ArrayLike, colours: NDArray[np.uint8] | None
    ) -> None:
        hits = np.asarray(points, dtype=np.float64)
        known = np.isfinite(hits).all(axis=1)
        places = fixed(self.plan.to_pixels(hits[known])).tolist()
        drawn = [SCAN_HIT] * len(places) if colours is None else colours[known].tolist()
        least = 1.1 if colours is None else 1.7  # a colour wants more than a pixel
        radius = round(max(least, 0.022 * self.plan.scale) * (1 << SHIFT))
        for place, colour in zip(places, drawn, strict=True):
            cv2.circle(picture, place, radius, colour, cv2.FILLED, cv2.LINE_AA, SHIFT)

    def _draw_trail(self, picture: Picture, path: Float, colour: icons.Colour) -> None:
        if len(path) < 2:
            return
        step = max(1, len(path) // MAX_TRAIL_POINTS)
        line = fixed(self.plan.to_pixels(np.vstack([path[:-1:step], path[-1:]])))
        width = max(1, round(0.035 * self.plan.scale))
        cv2.polylines(picture, [line], False, colour, width, cv2.LINE_AA, SHIFT)

    def _write(self, picture: Picture, names: Sequence[str], caption: str) -> None:
        height, width = picture.shape[:2]
        step = max(14, round(0.028 * height))
        if names:
            wide = step + max(text_width(name, height) for name in names) + 2 * PAD
            panel(picture, width - wide - 2 * PAD, 0, wide + 2 * PAD, len(names) * step + 2 * PAD)
        for row, name in enumerate(names):
            x, y = width - wide - PAD, PAD + row * step + step // 2
            cv2.line(picture, (x, y), (x + step, y), _trail_colour(name), 3, cv2.LINE_AA)
            write(picture, name, x + step + PAD, y)
        if caption:
            wide = text_width(caption, height)
            panel(picture, width - wide - 4 * PAD, height - step - PAD, wide + 4 * PAD, step + PAD)
            write(picture, caption, width - wide - 2 * PAD, height - (step + PAD) // 2)


def _trail_colour(name: str) -> icons.Colour:
    """Fixed for the usual names, else by the letters of the name."""
    return TRAILS.get(name) or OTHER_TRAILS[sum(name.encode()) % len(OTHER_TRAILS)]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Strokes:
    """All shapes of all movers in drawing order, laid out to be placed by one array operation.

    shapes    colour and width of each
    owner     (n_shapes,) row of its pose: a mover, then the people's feet
    spans     its polylines as ranges of ``points``
    points    (n, 2) m in the owner's frame, ``of_point`` (n,) the shape of each
    """

    shapes: tuple[icons.Shape, ...]
    owner: NDArray[np.int64]
    spans: tuple[tuple[tuple[int, int], ...], ...]
    points: Float
    of_point: NDArray[np.int64]


def _strokes(scene: Scene) -> _Strokes:
    cloth = _cloths(scene)
    foot_row = len(scene.movers)
    drawn: list[tuple[int, int, icons.Shape]] = []  # rank, owner, shape
    for row, mover in enumerate(scene.movers):
        worn = cloth.get(mover.name, {})
        shapes = icons.icon(mover.kind, mover.radius, worn.get("shirt") or worn.get("fabric"))
        rank = kind_of(mover.kind).z_order
        if mover.kind == "person":
            for foot in (foot_row, foot_row + 1):
                drawn += [(rank, foot, shape) for shape in icons.foot()]
            foot_row += 2
            shapes += icons.head(worn.get("hair", icons.INK), worn.get("skin", icons.SHADE))
        drawn += [(rank, row, shape) for shape in shapes]
    drawn.sort(key=lambda entry: entry[0])
    lines = [(k, line) for k, (_, _, shape) in enumerate(drawn) for line in shape.lines]
    ends = np.cumsum([0, *(len(line) for _, line in lines)]).tolist()
    spans: list[list[tuple[int, int]]] = [[] for _ in drawn]
    for (k, _), start, end in zip(lines, ends[:-1], ends[1:], strict=True):
        spans[k].append((start, end))
    return _Strokes(
        shapes=tuple(shape for _, _, shape in drawn),
        owner=np.array([owner for _, owner, _ in drawn], dtype=np.int64),
        spans=tuple(tuple(ranges) for ranges in spans),
        points=np.vstack([line for _, line in lines]),
        of_point=np.repeat([k for k, _ in lines], [len(line) for _, line in lines]),
    )


def _ankles(pose: Float) -> list[Float]:
    """Where a standing person's feet are."""
    x, y, yaw = pose.tolist()
    left = (-0.09 * math.sin(yaw), 0.09 * math.cos(yaw))
    return [np.array([x + s * left[0], y + s * left[1], yaw]) for s in (1.0, -1.0)]


def _cloths(scene: Scene) -> dict[str, dict[str, Any]]:
    """Mover -> slot ("shirt", "hair", "skin", "fabric") -> RGB, read from the model's materials."""
    colours = {
        m.name: tuple(round(255 * float(c)) for c in m.rgba[:3]) for m in scene.spec.materials
    }
    worn: dict[str, dict[str, Any]] = {}
    for body in scene.spec.bodies:
        owner = body.name.partition("/")[0]
        for geom in body.geoms:
            slot = geom.material.partition("_")[0]
            if slot in ("shirt", "hair", "skin", "fabric") and geom.material in colours:
                worn.setdefault(owner, {}).setdefault(slot, colours[geom.material])
    return worn
