# SPDX-License-Identifier: Apache-2.0
"""A picture of a world from above, drawn by OpenCV: no GL, a few milliseconds.

    view = MapView(scene, 1280, 720)
    picture = view.draw(world.mover_poses(), frame)

What a thing looks like from above its model says (``sim.view.parts``): outlines of its geoms, from
the lowest to the highest. What stays is painted once, paler than what moves.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike

from scenes.scene import Scene
from sim.core.bodies import STATIC
from sim.view import draw
from sim.view.draw import Color, Picture, View
from sim.view.parts import Parts
from sim.view.scans import FAN, beam_colors, beam_ends, silent_ends
from slam import se2
from slam.errors import InvalidValueError
from slam.frames import Float, Frame

WALL: Color = (66, 73, 88)
PALE, FLOOR_PALE = 0.42, 0.72  # share of paper in the colour of what stays, and of floors
RIM = 0.72  # of a colour: that of its outline
FLOOR_M = 0.02  # what is no higher lies on the floor
MARGIN_M = 0.3
FOOT_PX = 28  # row of the scale bar below the room
LOW_PX = 160  # a picture that is lower has no such row, and no bar
LEAST_PX = 1.0  # of what is drawn of a mover
FAN_SHARE = 0.34
AROUND = 24  # corners of a circle
DOT_M, LEAST_DOT = 0.022, 1.7  # radius of a hit, m, and px at least


class _Outline(NamedTuple):
    """A geom from above: row of its mover, height m, convex hull (k, 2) m in the mover's frame;
    colours of it and of its edge."""

    owner: int
    top: float
    hull: Float
    color: Color
    rim: Color


class MapView:
    """Draws one scene; ``width`` and ``height`` in px.

    scale  px per metre;   room  (height, width, 3) RGB of what stays
    """

    def __init__(self, scene: Scene, width: int, height: int) -> None:
        if not (32 <= width <= 8192 and 32 <= height <= 8192):
            raise InvalidValueError(f"a map must be 32..8192 px each way, got {width}x{height}")
        xmin, ymin, xmax, ymax = scene.bounds
        bounds = xmin - MARGIN_M, ymin - MARGIN_M, xmax + MARGIN_M, ymax + MARGIN_M
        self._foot = FOOT_PX if height >= LOW_PX else 0
        self._view = View.fitting(bounds, width, height - self._foot)
        self.scale = self._view.scale
        self._n_movers = len(scene.movers)
        outlines = _outlines(scene)
        self.room = self._painted([o for o in outlines if o.owner == STATIC], width, height)
        self.room.setflags(write=False)
        moving = [o for o in outlines if o.owner != STATIC]
        self._moving = [o for o in moving if np.ptp(o.hull, axis=0).max() * self.scale >= LEAST_PX]
        sizes = [len(o.hull) for o in self._moving]
        self._ends = np.cumsum(sizes)[:-1]
        self._owners = np.repeat([o.owner for o in self._moving], sizes)
        self._points = np.vstack([np.zeros((0, 2)), *(o.hull for o in self._moving)])

    def to_pixels(self, points_world: ArrayLike) -> Float:
        """(n, 2) px (column, row), fractional, of points (n, 2) m; pixel centres are whole."""
        pixels: Float = self._view.pixels(np.asarray(points_world, dtype=np.float64)) - 0.5
        return pixels

    def draw(self, poses: ArrayLike, frame: Frame | None = None) -> Picture:
        """A fresh (height, width, 3) RGB picture.

        poses  (n, 3) world poses of ``scene.movers`` in that order; a door's is its hinge and the
               direction of its leaf. Rows with NaN are not drawn
        frame  optional: its scan, seen from its true pose, beams by what they hit

        Raises ``InvalidValueError`` when the number of poses is not that of the movers.
        """
        places = np.asarray(poses, dtype=np.float64)
        if places.shape != (self._n_movers, 3):
            raise InvalidValueError(
                f"poses must have shape ({self._n_movers}, 3), got {places.shape}"
            )
        picture: Picture = self.room.copy()
        if frame is None or frame.scan is None or frame.truth is None:
            self._draw_movers(picture, places)
            return picture
        T_world_laser = se2.compose(frame.truth, frame.scan.spec.T_robot_laser)
        ends = beam_ends(frame.scan)
        ends[~frame.scan.valid] = silent_ends(frame.scan)
        hits = self.to_pixels(se2.transform(T_world_laser, ends))
        self._draw_fan(picture, np.vstack([self.to_pixels(T_world_laser[None, :2]), hits]))
        self._draw_movers(picture, places)
        draw.dots(picture, hits, beam_colors(frame), max(LEAST_DOT, DOT_M * self.scale))
        return picture

    def _draw_movers(self, picture: Picture, poses: Float) -> None:
        if not self._moving:
            return
        turns = np.array([[math.cos(yaw), math.sin(yaw)] for yaw in poses[:, 2].tolist()])
        cos, sin = turns[self._owners].T
        x, y = self._points.T
        turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=1)
        places = turned + poses[self._owners, :2]
        there = np.isfinite(poses.sum(axis=1))
        pixels = np.split(draw.fixed(self.to_pixels(np.nan_to_num(places))), self._ends)
        for outline, hull in zip(self._moving, pixels, strict=True):
            if there[outline.owner]:
                cv2.fillConvexPoly(picture, hull, outline.color, cv2.LINE_AA, draw.SHIFT)
                cv2.polylines(picture, [hull], True, outline.rim, 1, cv2.LINE_AA, draw.SHIFT)

    def _draw_fan(self, picture: Picture, outline: Float) -> None:
        """The swept area, see-through."""
        low = np.maximum(np.floor(outline.min(axis=0)).astype(int) - 1, 0)
        high = np.ceil(outline.max(axis=0)).astype(int) + 2
        window = picture[low[1] : high[1], low[0] : high[0]]
        if not window.size:
            return
        tinted = window.copy()
        draw.polygon(tinted, outline - low, FAN)
        cv2.addWeighted(tinted, FAN_SHARE, window, 1.0 - FAN_SHARE, 0.0, dst=window)

    def _painted(self, outlines: list[_Outline], width: int, height: int) -> Picture:
        """Floors, a soft shadow of what stands on them, walls and furniture."""
        picture: Picture = np.full((height, width, 3), draw.PAPER, np.uint8)
        shadow = np.zeros((height, width), np.uint8)
        for outline in outlines:
            pixels = self.to_pixels(outline.hull)
            if outline.top < FLOOR_M:
                draw.polygon(picture, pixels, outline.color)
            else:
                cv2.fillPoly(shadow, [draw.fixed(pixels)], 255, cv2.LINE_AA, draw.SHIFT)
        soft = cv2.GaussianBlur(shadow, (0, 0), max(1.0, 0.09 * self.scale))
        drop = round(0.05 * self.scale)
        dark = np.pad(soft, ((drop, 0), (drop, 0)))[:height, :width].astype(np.float32) / 255.0
        picture[:] = (picture * (1.0 - 0.28 * dark[..., None])).astype(np.uint8)
        for outline in outlines:
            if outline.top < FLOOR_M:
                continue
            pixels = self.to_pixels(outline.hull)
            draw.polygon(picture, pixels, outline.color)
            if outline.color != WALL:
                hull = [draw.fixed(pixels)]
                cv2.polylines(picture, hull, True, outline.rim, 1, cv2.LINE_AA, draw.SHIFT)
        if self._foot:
            draw.scale_bar(picture, View(0.0, 0.0, self.scale, width, height), 1.0)
        return picture


def _outlines(scene: Scene) -> list[_Outline]:
    """Of all that is seen of a scene, in the order in which it is drawn."""
    parts, seen = Parts(scene), dict[int, tuple[Color, int, list[Float]]]()
    for batch in parts.batches:
        corners = parts.corners(batch, AROUND)
        rows = zip(batch.geoms.tolist(), batch.colors.tolist(), batch.owners.tolist(), strict=True)
        for (geom, rgb, owner), points in zip(rows, corners, strict=True):
            if not parts.limbs[geom]:  # these are not where a pose alone says
                seen.setdefault(geom, (tuple(rgb), owner, []))[2].append(points)
    found = []
    for geom, (color, owner, pieces) in seen.items():
        points = np.concatenate(pieces)
        top, wall = float(points[:, 2].max()), parts.is_wall(geom)
        if owner == STATIC:
            color = WALL if wall else draw.paler(color, FLOOR_PALE if top < FLOOR_M else PALE)
        elif wall:
            continue  # the upper edge of a door has the walls' colour
        else:
            # (k, 3) m of the world in the frame of a pose on its floor
            flat = se2.transform(se2.inverse(parts.home[owner]), points[:, :2])
            points = np.column_stack([flat, points[:, 2]])
        hull = cv2.convexHull(points[:, :2].astype(np.float32))[:, 0].astype(np.float64)
        found.append(_Outline(owner, top, hull, color, draw.darker(color, RIM)))
    tops = [
        max((o.top for o in found if o.owner == k), default=0.0) for k in range(len(parts.home))
    ]
    return sorted(found, key=lambda o: (0.0 if o.owner == STATIC else tops[o.owner], o.top))
