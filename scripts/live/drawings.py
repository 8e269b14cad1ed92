# SPDX-License-Identifier: Apache-2.0
"""What was measured and estimated, as messages: scan, map, poses, ellipses, paths, landmarks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scripts.film import draw
from scripts.film.draw import Color
from scripts.film.map_pane import SIGMAS
from scripts.film.scan_pane import beam_colors, beam_ends
from scripts.live.sdk import Sdk
from slam import se2
from slam.estimate import Landmarks, Raster
from slam.frames import NS_PER_S, Float, Frame, Scan
from slam.maps import raster_image

LIFT_M = 0.02  # of lines above the floor, that they are seen; the map lies halfway
ARROW_M = 0.6
RING = 36  # corners of an ellipse
_BYTES = ("red", "green", "blue", "alpha", "label")  # of a point, after x, y, z
_OTHERS: tuple[Color, ...] = (draw.RED, draw.BLUE, (122, 63, 176))


class Drawings:
    """Makes messages; poses are (x m, y m, rad) on the floor."""

    def __init__(self, sdk: Sdk) -> None:
        self._m = sdk.messages
        self._numbers = {
            name: getattr(self._m.PackedElementFieldNumericType, name)
            for name in ("Uint8", "Float32")
        }

    def stamp(self, ns: int) -> Any:
        """A time of messages."""
        return self._m.Timestamp(sec=ns // NS_PER_S, nsec=ns % NS_PER_S)

    def color(self, rgb: Color, a: float = 1.0) -> Any:
        """Of 0 to 255."""
        r, g, b = (value / 255.0 for value in rgb)
        return self._m.Color(r=r, g=g, b=b, a=a)

    def pose(self, pose: Float, z: float = 0.0) -> Any:
        """On the floor, or above it."""
        x, y, yaw = (float(value) for value in pose)
        return self._m.Pose(position=self._m.Vector3(x=x, y=y, z=z), orientation=self._turn(yaw))

    def _turn(self, yaw: float) -> Any:
        return self._m.Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2.0), w=math.cos(yaw / 2.0))

    def transforms(self, stamp: Any, tree: Sequence[tuple[str, str, Float, float]]) -> Any:
        """(parent, child, pose, height m) each."""
        return self._m.FrameTransforms(
            transforms=[
                self._m.FrameTransform(
                    timestamp=stamp, parent_frame_id=parent, child_frame_id=child,
                    translation=self._m.Vector3(x=float(pose[0]), y=float(pose[1]), z=z),
                    rotation=self._turn(float(pose[2])),
                )
                for parent, child, pose, z in tree
            ]
        )  # fmt: skip

    def in_frame(self, stamp: Any, frame: str, pose: Float) -> Any:
        """A stamped pose."""
        return self._m.PoseInFrame(timestamp=stamp, frame_id=frame, pose=self.pose(pose))

    def scan(self, stamp: Any, scan: Scan) -> Any:
        """The ranges as they are; no return is infinite."""
        spec = scan.spec
        last = spec.angle_min + (spec.n_beams - 1) * spec.angle_increment
        return self._m.LaserScan(
            timestamp=stamp, frame_id="laser", start_angle=spec.angle_min, end_angle=last,
            ranges=scan.ranges.astype(np.float64).tolist(),
        )  # fmt: skip

    def points(self, stamp: Any, frame_id: str, frame: Frame) -> Any:
        """Where beams ended, coloured by what they hit, with the label: ``BeamClass``, 4 a mixed
        pixel, 255 where nothing says; the features of a log without scans."""
        if frame.scan is None:
            xy = np.zeros((0, 2)) if frame.features is None else frame.features.points_robot
            rgb = np.full((len(xy), 3), 40, np.uint8)
            label = np.full(len(xy), 255, np.uint8)
            frame_id = {"laser": "base_link", "truth_laser": "truth"}[frame_id]
        else:
            valid = frame.scan.valid
            xy, rgb = beam_ends(frame.scan)[valid], beam_colors(frame)[valid]
            label = np.full(len(xy), 255, np.uint8)
            if frame.labels is not None:
                label = np.where(frame.labels.mixed, 4, frame.labels.kind).astype(np.uint8)[valid]
        kinds = [*((name, "<f4") for name in "xyz"), *((name, "u1") for name in _BYTES)]
        packed = np.zeros(len(xy), dtype=kinds)
        packed["x"], packed["y"], packed["label"], packed["alpha"] = xy[:, 0], xy[:, 1], label, 255
        packed["red"], packed["green"], packed["blue"] = rgb.T
        fields = [
            self._m.PackedElementField(
                name=name, offset=4 * k if k < 3 else 9 + k,
                type=self._numbers["Float32" if kind == "<f4" else "Uint8"],
            )
            for k, (name, kind) in enumerate(kinds)
        ]  # fmt: skip
        return self._m.PointCloud(
            timestamp=stamp, frame_id=frame_id, pose=self.pose(np.zeros(3)),
            point_stride=packed.dtype.itemsize, fields=fields, data=packed.tobytes(),
        )  # fmt: skip

    def grid(self, stamp: Any, raster: Raster) -> Any:
        """The map in the colours of the pictures; unknown cells are transparent."""
        height, width = raster.values.shape
        cells = np.zeros((height, width, 4), np.uint8)
        cells[..., :3] = raster_image(raster)[::-1]
        cells[..., 3] = np.where(np.isnan(raster.values), 0, 255)
        names = ("red", "green", "blue", "alpha")
        side = raster.resolution_m
        return self._m.Grid(
            timestamp=stamp, frame_id="map", pose=self.pose(raster.T_map_origin, 0.5 * LIFT_M),
            column_count=width, cell_size=self._m.Vector2(x=side, y=side),
            row_stride=4 * width, cell_stride=4, data=cells.tobytes(),
            fields=[
                self._m.PackedElementField(name=name, offset=k, type=self._numbers["Uint8"])
                for k, name in enumerate(names)
            ],
        )  # fmt: skip

    def track(
        self, stamp: Any, pose: Float, covariance: Float | None, path: Float | None, color: Color
    ) -> Any:
        """A robot as an arrow and, where they are given, its path and its ellipse of ``SIGMAS``."""
        entities = [self._entity(stamp, "robot", arrows=[self._arrow(pose, color)])]
        if path is not None:
            entities.append(self._entity(stamp, "path", lines=[self._line(path, color, 0.03)]))
        if covariance is not None:
            ring = self._line(ellipse(pose, covariance), color, 0.03, closed=True)
            entities.append(self._entity(stamp, "ellipse", lines=[ring]))
        return self._m.SceneUpdate(entities=entities)

    def landmarks(self, stamp: Any, found: Landmarks) -> Any:
        """All of them with their ellipses, in one entity."""
        rings = [
            self._line(ellipse(at, covariance), draw.INK, 0.03, closed=True)
            for at, covariance in zip(found.points_map, found.covariances, strict=True)
        ]
        return self._m.SceneUpdate(entities=[self._entity(stamp, "landmarks", lines=rings)])

    def log(self, stamp: Any, level: str, text: str) -> Any:
        """One line for a log."""
        kind = self._m.LogLevel.Warning if level == "warning" else self._m.LogLevel.Info
        return self._m.Log(timestamp=stamp, level=kind, message=text, name="mobilia")

    def _entity(self, stamp: Any, name: str, **parts: Any) -> Any:
        return self._m.SceneEntity(timestamp=stamp, frame_id="map", id=name, **parts)

    def _arrow(self, pose: Float, color: Color) -> Any:
        return self._m.ArrowPrimitive(
            pose=self.pose(pose, 0.25), shaft_length=0.7 * ARROW_M, shaft_diameter=0.08,
            head_length=0.3 * ARROW_M, head_diameter=0.2, color=self.color(color),
        )  # fmt: skip

    def _line(self, xy: Float, color: Color, wide: float, *, closed: bool = False) -> Any:
        kinds = self._m.LinePrimitiveLineType
        return self._m.LinePrimitive(
            type=kinds.LineLoop if closed else kinds.LineStrip, pose=self.pose(np.zeros(3)),
            thickness=wide, color=self.color(color),
            points=[self._m.Point3(x=x, y=y, z=LIFT_M) for x, y in xy.tolist()],
        )  # fmt: skip


def ellipse(pose: Float, covariance: Float) -> Float:
    """(RING, 2) m around a pose, at ``SIGMAS``."""
    values, vectors = np.linalg.eigh(np.asarray(covariance)[:2, :2])
    turns = np.linspace(0.0, math.tau, RING, endpoint=False)
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ring: Float = (
        np.asarray(pose)[:2] + SIGMAS * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    )
    return ring


def frames_of(
    T_world_map: Float, T_map_robot: Float, frame: Frame, truth_map: Float | None, height_m: float
) -> list[tuple[str, str, Float, float]]:
    """The tree: world, map, odom, base_link, laser; beside it the truth with a laser of its own."""
    odometry = frame.odometry.T_odom_robot
    T_map_odom = se2.compose(T_map_robot, se2.inverse(odometry))
    tree: list[tuple[str, str, Float, float]] = [
        ("world", "map", T_world_map, 0.0),
        ("map", "odom", T_map_odom, 0.0),
        ("odom", "base_link", odometry, 0.0),
    ]
    mounted = np.zeros(3) if frame.scan is None else frame.scan.spec.T_robot_laser
    tree.append(("base_link", "laser", mounted, height_m))
    if truth_map is not None:
        tree.append(("map", "truth", truth_map, 0.0))
        tree.append(("truth", "truth_laser", mounted, height_m))
    return tree


def colors_of(names: Sequence[str]) -> Mapping[str, Color]:
    """A colour for each track, as in films."""
    rest = [name for name in names if name != "odometry"]
    found = {name: _OTHERS[k % len(_OTHERS)] for k, name in enumerate(rest)}
    return {**found, "odometry": draw.ORANGE}
