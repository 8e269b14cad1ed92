# SPDX-License-Identifier: Apache-2.0
"""A run as a recording for the Rerun viewer, to scrub through (extra ``rerun``)."""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from scripts.film.map_pane import SIGMAS
from scripts.film.scan_pane import beam_colors, beam_ends
from scripts.film.show import Show
from slam import se2
from slam.errors import MissingDependencyError
from slam.files import replacing
from slam.frames import Float, Frame

MAP_EVERY_S = 1.0
SCAN_EVERY_S = 0.1  # a viewer needs no more, and ten times as many fill the disk


class RerunLog:
    """Writes scans, poses, trails, map, truth and errors of a show."""

    def __init__(self, sdk: Any, recording: Any, show: Show) -> None:
        self._sdk, self._recording, self._show = sdk, recording, show
        self._map_s = self._scan_s = -math.inf

    @staticmethod
    def require() -> Any:
        """The SDK; ``MissingDependencyError`` with a remedy where it is not installed."""
        try:
            return importlib.import_module("rerun")
        except ImportError as error:
            raise MissingDependencyError(
                "--rerun needs the Rerun SDK: pip install 'mobilia[rerun]'"
            ) from error

    @classmethod
    @contextmanager
    def writing(cls, path: Path, show: Show) -> Iterator[RerunLog]:
        """A recording that appears under ``path`` when the block ends well."""
        sdk = cls.require()
        with replacing(path) as temporary:
            recording = sdk.RecordingStream("mobilia", recording_id=show.title)
            recording.save(str(temporary))
            yield cls(sdk, recording, show)
            recording.flush()
            recording.disconnect()

    def note(self, frame: Frame) -> None:
        """Log a frame; call after the show's ``note``."""
        seconds = self._show.seconds(frame)
        self._recording.set_time("run", duration=seconds)
        self._poses(frame)
        self._errors()
        if frame.scan is not None and seconds - self._scan_s >= SCAN_EVERY_S - 1e-6:
            self._scan_s = seconds
            self._scan(frame)
        if seconds - self._map_s >= MAP_EVERY_S - 1e-6:
            self._map_s = seconds
            self._map()

    def _log(self, path: str, *what: Any) -> None:
        self._recording.log(path, *what)

    def _poses(self, frame: Frame) -> None:
        show, sdk = self._show, self._sdk
        for name, trail in show.trails.items():
            self._log(
                f"map/{_entity(name)}",
                sdk.Arrows2D(
                    origins=[trail.pose[:2]],
                    vectors=[0.5 * np.array([math.cos(trail.pose[2]), math.sin(trail.pose[2])])],
                    colors=[show.color(name)],
                ),
            )
        estimate = show.replay.tracks[show.primary].estimates[-1]
        ring = _ellipse(estimate.T_map_robot, estimate.covariance)
        self._log(
            f"map/{_entity(show.primary)}/ellipse",
            sdk.LineStrips2D([ring], colors=[show.color(show.primary)]),
        )

    def _errors(self) -> None:
        for name, series in self._show.series.items():
            values = {
                "position_error_m": series.position[-1],
                "heading_error_deg": math.degrees(series.heading[-1]),
                "position_2_sigma_m": series.claimed[-1],
                "heading_2_sigma_deg": math.degrees(series.claimed_rad[-1]),
            }
            for key, value in values.items():
                if math.isfinite(value):
                    self._log(f"{key}/{_entity(name)}", self._sdk.Scalars(value))

    def _scan(self, frame: Frame) -> None:
        assert frame.scan is not None
        here = self._show.trails[self._show.primary].pose
        T_map_laser = se2.compose(here, frame.scan.spec.T_robot_laser)
        points = se2.transform(T_map_laser, beam_ends(frame.scan)[frame.scan.valid])
        colors = beam_colors(frame)[frame.scan.valid]
        self._log("map/scan", self._sdk.Points2D(points, colors=colors, radii=0.03))

    def _map(self) -> None:
        """Cells of the map as points, darker where surer."""
        raster = self._show.replay.tracks[self._show.primary].map()
        if raster is None:
            return
        rows, columns = np.nonzero(np.nan_to_num(raster.values) > 0.1)
        cells = np.stack([columns + 0.5, rows + 0.5], axis=1) * raster.resolution_m
        shade = (200.0 * (1.0 - raster.values[rows, columns])).astype(np.uint8)
        self._log(
            "map/activities",
            self._sdk.Points2D(
                se2.transform(raster.T_map_origin, cells),
                colors=np.repeat(shade[:, None], 3, axis=1),
                radii=0.5 * raster.resolution_m,
                draw_order=-1.0,
            ),
        )


def _entity(name: str) -> str:
    """A SLAM's name as part of an entity path."""
    return "".join(c if c.isalnum() or c in "-_" else "-" for c in name)


def _ellipse(T_map_robot: Float, covariance: Float) -> Float:
    """(k, 2) m, the ring of ``SIGMAS``."""
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    turns = np.linspace(0.0, math.tau, 33)
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    ring: Float = T_map_robot[:2] + SIGMAS * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return ring
