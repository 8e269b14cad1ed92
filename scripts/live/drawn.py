# SPDX-License-Identifier: Apache-2.0
"""A moment in a scene of viser: what the page of the live view and ``replay.html`` show.

Room and scan lie in the world; map, estimates and paths in the map, which lies where the run began.
"""

import html
import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scripts.film.map_pane import COLORS, FOLLOW_M
from sim.view import draw
from sim.view.draw import Color
from sim.view.moment import Moments, Path, Shown, ellipse
from sim.view.parts import BOX, Parts, Placed, mesh
from sim.world.world import World
from slam import se2
from slam.estimate import Landmarks, Raster
from slam.frames import Float

LIFT_M = 0.03  # of the map and of lines above the floor, that they are seen
ROBOT_M = 0.45  # height at which the arrow of an estimate floats: above a robot
POINT_M = 0.05
NEAR_M = 8.0  # steps of the place from which the points of a scan are counted
PATH_POINTS = 400  # of a path as drawn
PATH_S = 1.0  # so often of the run it is drawn anew
LEVELS = 8  # of a cell of it that are told apart
STEPS_M, STEPS_TURN = 512.0, 1024.0  # parts of a metre and of a turn that are told apart
FOV = 0.7  # rad, of a page's camera, up and down
OUT = 0.4  # m to the side that it stands off for each m up
HIGH_M = 1.0  # of what is surely in view
SPARE = 0.93  # of a picture: what the room takes up
AROUND = 9  # corners of a circle as drawn
GAMMA = 2.2  # of a screen
_NO_SHADOW = {"cast_shadow": False, "receive_shadow": False}
_ARROW = np.array([[0.32, 0.0, 0.0], [-0.22, 0.2, 0.0], [-0.1, 0.0, 0.0], [-0.22, -0.2, 0.0]])


class Drawn:
    """Draws moments into a ``viser.SceneApi``; used by one thread.

    parts   what is seen of the room, None for a log
    map_s   so often at most the map is drawn anew, s of the run
    """

    def __init__(
        self, scene: Any, moments: Moments, world: World | None = None, map_s: float = 0.0
    ) -> None:
        self._scene, self.moments = scene, moments
        self.parts = None if world is None else Parts(world.scene, world.model)
        self._height_m = 0.0 if world is None else world.scene.scan_height_m
        self._room_bounds = None if world is None else world.scene.bounds
        self._nodes: dict[str, Any] = {}
        self._values: dict[str, Any] = {}
        self._placed: Placed | None = None
        self._map: tuple[Raster | None, Landmarks | None] = (None, None)
        self._path_s = self._map_s = -math.inf
        self._map_rest_s = map_s
        scene.configure_default_lights(False)
        scene.configure_environment_map(None)
        scene.add_light_hemisphere("/light/sky", ground_color=(150, 150, 150), intensity=2.4)
        scene.add_light_directional("/light/sun", intensity=1.5, position=(-3.0, -6.0, 9.0))

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of the room, m; of a log, of what lies about the path so far."""
        if self._room_bounds is not None:
            return self._room_bounds
        points = np.vstack([np.zeros(2), self.moments.paths[self.moments.primary].points()])
        (xmin, ymin), (xmax, ymax) = points.min(axis=0) - FOLLOW_M, points.max(axis=0) + FOLLOW_M
        return float(xmin), float(ymin), float(xmax), float(ymax)

    def draw(self, shown: Shown) -> None:
        """Make the scene show it."""
        if "map" not in self._nodes:
            wxyz, position = _pose(shown.T_world_map)
            self._nodes["map"] = self._scene.add_frame(
                "/map", show_axes=False, wxyz=wxyz, position=position
            )
        if self.parts is not None and shown.placed is not None:
            self._room(self.parts, shown.placed)
        self._scan(shown)
        due = abs(shown.seconds - self._map_s) >= self._map_rest_s - 1e-6
        if due and self._map != (shown.raster, shown.landmarks):
            self._map_s, self._map = shown.seconds, (shown.raster, shown.landmarks)
            self._cells(shown.raster)
            self._landmarks(shown.landmarks)
        renew = abs(shown.seconds - self._path_s) >= PATH_S
        self._path_s = shown.seconds if renew else self._path_s
        for name, (pose, covariance) in shown.robots().items():
            self._track(name, pose, covariance)
        if renew:
            for name, path in self.moments.paths.items():
                self._path(name, path, shown.number)

    # -- the room -----------------------------------------------------------------------------

    def _room(self, parts: Parts, placed: Placed) -> None:
        if placed is self._placed:
            return
        first, self._placed = self._placed is None, placed
        parts.place(placed)
        for k, batch in enumerate(parts.batches):
            if not (first or batch.moves):
                continue
            centres, quats = parts.poses(batch)
            centres, quats = np.rint(centres * STEPS_M) / STEPS_M, np.rint(quats * STEPS_TURN)
            name, (vertices, faces) = f"room/{k}_{batch.shape}", mesh(batch.shape, AROUND)
            add = partial(
                self._scene.add_batched_meshes_simple, f"/{name}", vertices, faces,
                batched_scales=batch.sizes.astype(np.float32), batched_colors=_linear(batch.colors),
                batched_opacities=batch.opacity if batch.glass else None,
                flat_shading=batch.shape == BOX, lod="off", **_NO_SHADOW,
            )  # fmt: skip
            self._put(name, add, batched_positions=centres, batched_wxyzs=quats / STEPS_TURN)

    # -- what is measured and estimated ---------------------------------------------------------

    def _scan(self, shown: Shown) -> None:
        """Where beams ended: where the robot truly is, in a log where it is believed to be."""
        here = shown.own.T_map_robot if shown.truth_map is None else shown.truth_map
        xy, rgb = shown.scan_map(here)
        # a slow page moves nodes at once and points later: where they lie, points say, and of few m
        near = np.round(np.r_[here[:2], 0.0] / NEAR_M) * NEAR_M
        wxyz, position = _pose(near, self._height_m + LIFT_M)
        points = np.column_stack([xy - near[:2], np.zeros(len(xy))]).astype(np.float16)
        add = partial(
            self._scene.add_point_cloud, "/map/scan", point_size=POINT_M, point_shape="circle",
            point_shading="flat", wxyz=wxyz,
        )  # fmt: skip
        self._put("scan", add, points=points, colors=rgb, position=position)

    def _cells(self, raster: Raster | None) -> None:
        """The map in the colours of films; where nothing is, one sees the floor."""
        if raster is None:
            return
        known = np.round(np.nan_to_num(raster.values[::-1]) * LEVELS) / LEVELS  # few: a small file
        cells = np.empty((*known.shape, 4), np.uint8)
        cells[..., :3] = COLORS[np.round(255.0 * known).astype(np.uint8), 0]
        cells[..., 3] = 255.0 * np.minimum(known * 2.0, 1.0)
        high, wide = (float(n * raster.resolution_m) for n in raster.values.shape)
        middle = se2.compose(raster.T_map_origin, np.array([0.5 * wide, 0.5 * high, 0.0]))
        (w, _, _, z), position = _pose(middle, LIFT_M)
        # a picture's second axis goes down: turned half round its first, it lies on its back
        self._nodes["cells"] = self._scene.add_image(
            "/map/cells", cells, wide, high, wxyz=(0.0, w, z, 0.0), position=position,
            **_NO_SHADOW,
        )  # fmt: skip

    def _landmarks(self, landmarks: Landmarks | None) -> None:
        if landmarks is None:
            return
        rings = [
            point + ellipse(covariance)
            for point, covariance in zip(landmarks.points_map, landmarks.covariances, strict=True)
        ]
        lines = [_segments(ring, closed=True) for ring in rings]
        self._lines("landmarks", np.concatenate([np.zeros((0, 2, 3)), *lines]), draw.INK, 0.02)

    def _track(self, name: str, pose: Float, covariance: Float | None) -> None:
        """A robot as an arrow, with its ellipse."""
        (wxyz, position), color = _pose(pose), self.moments.colors[name]
        if name not in self._nodes:
            node = f"/map/{_node(name)}"
            self._nodes[name] = self._scene.add_frame(
                node, show_axes=False, wxyz=wxyz, position=position
            )
            self._scene.add_mesh_simple(
                f"{node}/arrow", _ARROW + np.array([0.0, 0.0, self._height_m + ROBOT_M]),
                np.array([[0, 1, 2], [0, 2, 3]]), color=color, side="double", **_NO_SHADOW,
            )  # fmt: skip
        self._set(name, wxyz=wxyz, position=position)
        if covariance is not None:
            turn = se2.rotation(-float(pose[2]))
            ring = ellipse(turn @ covariance[:2, :2] @ turn.T)
            self._lines(f"{name}/ellipse", _segments(ring, closed=True), color, 0.025)

    def _path(self, name: str, path: Path, number: int) -> None:
        way = _segments(path.points(PATH_POINTS, number))
        if len(way):
            self._lines(f"path/{name}", way, self.moments.colors[name], 0.03)

    def _lines(self, name: str, segments: Float, color: Color, wide_m: float) -> None:
        segments = np.round(segments, 3).astype(np.float32)
        colors = np.broadcast_to(_linear(np.array(color)), segments.shape)
        if len(segments) or name in self._nodes:
            node = f"/map/{'/'.join(map(_node, name.split('/')))}"
            add = partial(self._scene.add_line_segments, node, thickness=wide_m)
            self._put(name, add, points=segments, colors=colors)

    def _put(self, name: str, add: Callable[..., Any], **values: Any) -> None:
        """Make the node, or tell it what has changed."""
        if name in self._nodes:
            self._set(name, **values)
        else:
            self._nodes[name] = add(**values)

    def _set(self, name: str, **values: Any) -> None:
        """Tell the node what has changed."""
        node, known = self._nodes[name], self._values.setdefault(name, {})
        for key, value in values.items():
            if key not in known or not np.array_equal(known[key], value):
                known[key] = value
                setattr(node, key, value)


def _pose(pose: Float, z: float = 0.0) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A turn (w, x, y, z) and a place of a pose on the floor, or above it."""
    x, y, yaw = (float(value) for value in pose)
    return (math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0)), (x, y, z)


def _segments(xy: Float, *, closed: bool = False) -> Float:
    """(n, 2, 3) m, the pieces of a line above the floor."""
    xyz = np.column_stack([xy, np.full(len(xy), LIFT_M + 0.01)])
    ends = np.roll(xyz, -1, axis=0)
    pieces: Float = np.stack([xyz, ends], axis=1)
    return pieces if closed else pieces[:-1]


def _linear(rgb: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours of batches and of lines as viser takes them: in linear light."""
    return np.rint(255.0 * (rgb / 255.0) ** GAMMA).astype(np.uint8)


def _node(name: str) -> str:
    """A track's name as part of a name in the scene."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name)


def look_at(camera: Any, bounds: Sequence[float], aspect: float) -> None:
    """Let a camera look at a room from the south and from above, from so near that the room fills a
    picture of that width by height; from the west where its longer side fits better so."""
    xmin, ymin, xmax, ymax = bounds
    turned = (xmax - xmin > ymax - ymin) != (aspect > 1.0)
    ahead = np.array([OUT, 0.0, -1.0] if turned else [0.0, OUT, -1.0]) / math.hypot(OUT, 1.0)
    right = np.array([0.0, -1.0, 0.0] if turned else [1.0, 0.0, 0.0])
    corners = np.array([*itertools.product((xmin, xmax), (ymin, ymax), (0.0, HIGH_M))])
    back_m, position, reach = 0.0, np.zeros(3), SPARE * math.tan(0.5 * FOV)
    for way, slope in ((right, reach * aspect), (np.cross(right, ahead), reach)):
        # how far the planes through the camera that bound its sight lie out, on either side
        far, near = (float((corners @ (s * way - slope * ahead)).max()) for s in (1.0, -1.0))
        back_m = max(back_m, 0.5 * (far + near) / slope)
        position += 0.5 * (far - near) * way
    position -= back_m * ahead
    camera.fov, camera.position = FOV, tuple(position.tolist())
    camera.look_at = tuple((position - position[2] / ahead[2] * ahead).tolist())


def told(shown: Shown) -> str:
    """What a moment's SLAM says of itself and how far off it is, in colour, as HTML."""
    words = (
        f"<b style='color:{'inherit' if color == draw.INK else f'rgb{color}'}'>"
        f"{html.escape(text)}</b>"
        for text, color in shown.told()
    )
    return f"{html.escape(shown.primary)}: {'<br>'.join(words)}"


def legend(moments: Moments) -> str:
    """Which colour is whose, as HTML; beams without a return are not drawn."""
    looks = {word: f"rgb{color}" for word, color in moments.legend() if color != draw.GRAY}
    stops = ",".join(f"rgb{tuple(color)}" for color in COLORS[[30, 90, 180, 255], 0].tolist())
    looks["map, the darker the surer"] = f"linear-gradient(90deg,{stops})"
    rows = (
        f"<span><i style='background:{look}'></i>{html.escape(word)}</span>"
        for word, look in looks.items()
    )
    return f"<div class=key>{' '.join(rows)}</div>"
