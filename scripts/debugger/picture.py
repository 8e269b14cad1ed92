# SPDX-License-Identifier: Apache-2.0
"""``blame.png``: the run as it was above the run without the culprit, and everybody's errors below.

In a picture from above everything stands where it truly is; the scan (red) is drawn where the SLAM
believed it was seen from, so walls and red part company when the SLAM goes astray.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from scenes.kinds import is_door
from scripts.debugger.counterfactual import CURED, Inquest, Trial
from scripts.debugger.recording import Strip, simulate
from scripts.debugger.words import headline, who
from scripts.figures import styled
from scripts.film.strips import strips
from sim.twins.absence import Change
from sim.view import draw
from sim.view.draw import Picture
from sim.view.mapview import MapView
from slam import se2
from slam.files import replacing
from slam.frames import NS_PER_S, Float, Frame

CULPRIT: draw.Color = (176, 32, 190)
CELL_PX = 380
PX_PER_M = 56.0
RIM_M = 0.2  # of the plan below the room
SIDE_M = (3.5, 9.0)  # least and most of what a cell shows
MOMENTS = 5
MAX_PX = 8000
THICK = 3
LABEL_PX, LINE_PX = 16, 20  # of words in a cell
ROOM = 1.8  # of the chart, times the original's greatest error


def blame_picture(path: Path, found: Inquest) -> None:
    """Write it."""
    seconds, rows = _moments(found)
    camera = _Camera(found)
    shown = _shown(found)
    parts = {"as it was": camera.row(found.tape.strip, rows, None)}
    if shown is not None:
        parts[who(shown)] = camera.row(shown.strip, [row - found.first for row in rows], shown)
    cells = strips(parts, seconds, cell_width=CELL_PX)
    picture = np.vstack([_title(found, cells.shape[1]), cells, _chart(found, cells.shape[1])])
    with replacing(path) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", optimize=True)


def _shown(found: Inquest) -> Trial | None:
    """The re-run beside the original: the best cure, else everybody out."""
    able = [trial for trial in found.trials if not trial.failed]
    return next(iter(found.named or found.cures or found.together or able), None)


def _moments(found: Inquest) -> tuple[list[float], list[int]]:
    """Seconds and rows of the cells; the whole run where nothing happened."""
    stamps = found.tape.strip.stamps_ns()
    if found.moment is None:
        rows = np.linspace(0, len(stamps) - 1, MOMENTS).astype(int).tolist()
    else:
        middle = (found.moment.found + found.last) // 2
        rows = [found.first, found.moment.begins, found.moment.found, middle, found.last]
        rows = sorted({min(row, found.last) for row in rows})
    return [float(stamps[row] - stamps[0]) / NS_PER_S for row in rows], rows


class _Camera:
    """Looks at the same square of the floor at all moments."""

    def __init__(self, found: Inquest) -> None:
        self._found = found
        scene = simulate(found.tape.case).world.scene
        xmin, ymin, xmax, ymax = scene.bounds
        scale = min(PX_PER_M, MAX_PX / max(xmax - xmin + 1.0, ymax - ymin + 1.0))
        size = [max(64, round((side + 0.6) * scale)) for side in (xmax - xmin, ymax - ymin)]
        self._view = MapView(scene, *size)
        self._radii = [mover.radius for mover in scene.movers]
        self._foot = round(float(self._view.to_pixels([[xmin, ymin - RIM_M]])[0][1]))
        self._window = self._square()

    def _square(self) -> tuple[int, int, int, int]:
        """(x0, y0, x1, y1) px around everything that matters, and square."""
        found, strip = self._found, self._found.tape.strip
        rows = _moments(found)[1]
        span = range(rows[0], rows[-1] + 1)
        points = [strip.truth[row][:2] for row in span]
        points += [self._world(strip.believed[row])[:2] for row in span]
        for _, names in _labelled(found):
            columns = [found.tape.names.index(name) for name in names]
            points += [strip.poses[row][m][:2] for row in span for m in columns]
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        most = SIDE_M[1] if found.moment is not None else math.inf  # the whole path of a good run
        side = min(max(float((high - low).max()) + 2.0, SIDE_M[0]), most)
        half = 0.5 * side * self._view.scale
        x, y = self._view.to_pixels([0.5 * (low + high)])[0]
        width = self._view.room.shape[1]
        height = self._foot  # below it is the plan's own scale
        x = min(max(x, half), max(width - half, 0.5 * width))
        y = min(max(y, half), max(height - half, 0.5 * height))
        left, top = max(0, round(x - half)), max(0, round(y - half))
        return left, top, round(x + half), min(round(y + half), self._foot)

    def _world(self, T_map_robot: Float) -> Float:
        return se2.compose(self._found.tape.T_world_map, T_map_robot)

    def row(self, strip: Strip, rows: Sequence[int], trial: Trial | None) -> list[Picture]:
        """The pictures of a strip at some of its rows."""
        return [self._cell(strip, row, rows[0], trial) for row in rows]

    def _cell(self, strip: Strip, row: int, first: int, trial: Trial | None) -> Picture:
        change = Change() if trial is None else trial.change
        names = self._found.tape.names
        poses = strip.poses[row].copy()
        poses[[names.index(name) for name in change.out]] = np.nan
        picture = self._view.draw(poses)
        for path, color in (
            (strip.truth[first : row + 1], draw.GREEN),
            ([self._world(pose) for pose in strip.believed[first : row + 1]], draw.BLUE),
        ):
            draw.polyline(picture, self._view.to_pixels(np.array(path)[:, :2]), color, 2)
        believed = self._world(strip.believed[row])
        self._hits(picture, strip.frames[row], believed)
        self._outline(picture, believed)
        was = self._found.tape.strip.poses[row if trial is None else row + self._found.first]
        words: list[tuple[int, int, int, int]] = []
        for label, group in _labelled(self._found):
            for name in group:
                gone = name in change.out
                self._ring(picture, was if gone else poses, names.index(name), gone)
            first_of = names.index(group[0])
            at = was if group[0] in change.out else poses
            words.append(self._label(picture, at, first_of, label, words))
        x0, y0, x1, y1 = self._window
        cell = np.ascontiguousarray(picture[y0:y1, x0:x1])
        left, low, metre = 14, len(cell) - 14, round(self._view.scale)
        for color, thick in ((draw.PAPER, 3 * THICK), (draw.INK, THICK)):
            cv2.line(cell, (left, low), (left + metre, low), color, thick, cv2.LINE_AA)
        _write(cell, "1 m", (left, low - 26), draw.INK)
        return cell

    def _hits(self, picture: Picture, frame: Frame, T_world_robot: Float) -> None:
        if frame.scan is None:
            return
        valid = frame.scan.valid
        ranges, angles = frame.scan.ranges[valid], frame.scan.spec.angles[valid]
        points = np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)
        T_world_laser = se2.compose(T_world_robot, frame.scan.spec.T_robot_laser)
        for pixel in self._view.to_pixels(se2.transform(T_world_laser, points)).round().tolist():
            cv2.circle(picture, (int(pixel[0]), int(pixel[1])), 3, draw.RED, -1, cv2.LINE_AA)

    def _outline(self, picture: Picture, pose: Float) -> None:
        """Where the robot is believed to be."""
        reach = 0.3
        nose = pose[:2] + 1.5 * reach * np.array([math.cos(pose[2]), math.sin(pose[2])])
        centre, tip = self._view.to_pixels([pose[:2], nose]).round().astype(int).tolist()
        radius = round(reach * self._view.scale)
        cv2.circle(picture, centre, radius, draw.BLUE, THICK, cv2.LINE_AA)
        cv2.line(picture, centre, tip, draw.BLUE, THICK, cv2.LINE_AA)

    def _label(
        self,
        picture: Picture,
        poses: Float,
        m: int,
        label: str,
        others: Sequence[tuple[int, int, int, int]],
    ) -> tuple[int, int, int, int]:
        """The word beside the first of those named, within the cell and clear of the ``others``;
        x, y, width, height (px) of it."""
        x, y = self._view.to_pixels([poses[m][:2]])[0].round().astype(int).tolist()
        side = round((self._radii[m] + 0.2) * self._view.scale)
        wide = draw.text_width(label, LABEL_PX, bold=True)
        left, top, right, low = self._window
        x = x + side if x + side + wide <= right else x - side - wide
        x, y = max(x, left + 2), min(max(y - 8, top + 2), low - LINE_PX)
        while any(
            x < a + w and a < x + wide and y < b + h and b < y + LINE_PX for a, b, w, h in others
        ):
            y += LINE_PX
        _write(picture, label, (x, y), CULPRIT, bold=True)
        return x, y, wide, LINE_PX

    def _ring(self, picture: Picture, poses: Float, m: int, gone: bool) -> None:
        """Around somebody named; in dashes where one was who is out."""
        x, y, yaw = poses[m].tolist()
        radius = self._radii[m] + 0.12
        if is_door(self._found.tape.kinds[m]):
            radius = 0.5 * self._radii[m] + 0.1
            x += 0.5 * self._radii[m] * math.cos(yaw)
            y += 0.5 * self._radii[m] * math.sin(yaw)
        centre = self._view.to_pixels([[x, y]])[0].round().astype(int).tolist()
        size = round(radius * self._view.scale)
        for start in range(0, 360, 30):
            end = start + (15 if gone else 30)
            cv2.ellipse(
                picture, centre, (size, size), 0, start, end, CULPRIT, THICK, cv2.LINE_AA
            )  # fmt: skip


def _write(
    picture: Picture, words: str, at: tuple[int, int], color: draw.Color, bold: bool = False
) -> None:
    """Words with a rim of paper: readable on floors, walls and people."""
    for x, y in ((-2, 0), (2, 0), (0, -2), (0, 2), (-1, -1), (1, 1), (-1, 1), (1, -1)):
        draw.text(picture, words, (at[0] + x, at[1] + y), LABEL_PX, draw.PAPER, bold=bold)
    draw.text(picture, words, at, LABEL_PX, color, bold=bold)


def _labelled(found: Inquest) -> list[tuple[str, tuple[str, ...]]]:
    """Who the verdict names, or would have, trial by trial, with the word for all of each."""
    trials = [t for t in found.named or found.cures[:1] if t.kind != "all"]
    changes = [trial.change for trial in trials]
    return [(c.called or (c.out or c.frozen)[0], c.out or c.frozen) for c in changes]


def _title(found: Inquest, width: int) -> Picture:
    picture: Picture = np.full((92, width, 3), draw.PAPER, np.uint8)
    words = headline(found)
    draw.text(picture, words[0], (14, 12), 20, draw.INK, bold=True)
    case = found.tape.case
    draw.text(picture, f"{case.slam} · {case.title}. {words[1]}", (14, 42), 14, draw.MUTED)
    x = 14
    legend: list[tuple[str, draw.Color]] = [("truth", draw.GREEN), ("believed", draw.BLUE)]
    legend += [("scan, where it is believed to be", draw.RED)]
    if _labelled(found):
        legend += [("who is named (dashes: where it was when it is out)", CULPRIT)]
    for name, color in legend:
        cv2.line(picture, (x, 76), (x + 22, 76), color, 4, cv2.LINE_AA)
        x = draw.text(picture, name, (x + 28, 68), 14, draw.INK) + 26
    return picture


@styled({"axes.grid": False})
def _chart(found: Inquest, width: int) -> Picture:
    """Error over time of the original and of every re-run."""
    figure = Figure(figsize=(width / 100.0, 3.6), dpi=100, layout="constrained")
    figure.set_facecolor([c / 255.0 for c in draw.PAPER])
    ax = figure.subplots()
    stamps = found.tape.strip.stamps_ns()
    errors = found.tape.strip.errors_m(found.then)
    times = (stamps - stamps[0]) / NS_PER_S
    best = {id(trial): trial for trial in found.named or found.cures[:1]}
    for trial in sorted(found.trials, key=lambda t: id(t) in best):
        if not trial.failed:
            _curve(ax, found, trial, times, id(trial) in best)
    last = found.last + 1 if found.moment is not None else len(times)
    ax.plot(times[found.first : last], errors[found.first : last], color="#20242c", lw=2.4,
            label="as it was", zorder=5)  # fmt: skip
    if found.moment is not None:
        ax.axvline(times[found.moment.begins], color="#787e8a", lw=1.0, ls=":")
        ax.axvline(times[found.moment.found], color="#787e8a", lw=1.0)
        for row, word in ((found.moment.begins, "begins "), (found.moment.found, "found ")):
            ax.text(times[row], 1.0, word, transform=ax.get_xaxis_transform(), va="top",
                    ha="right", color="#787e8a")  # fmt: skip
        if found.trials:
            ax.axhline(
                CURED * found.rise_m, color="#168c5a", lw=0.9, ls=(0, (2, 3)), label="below: cured"
            )
    what = "error" if found.moment is None else "error since the checkpoint"
    ax.set(
        xlabel="time, s", ylabel=f"{what}, m\n(position + 1 m × heading)",
        xlim=(times[found.first], times[last - 1]),
    )  # fmt: skip
    ax.set_ylim(0.0, ROOM * float(errors[found.first : last].max()))  # a worse one leaves the chart
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[:, :width, :3])


def _curve(ax: mpl.axes.Axes, found: Inquest, trial: Trial, times: Float, named: bool) -> None:
    rows = slice(found.first, found.first + len(trial.strip.frames))
    errors = trial.strip.errors_m(found.then)
    label = str(trial.change)
    style: dict[str, Any] = {"lw": 1.3, "ls": "-" if trial.change.out else "--"}
    if trial.kind == "all":
        style |= {"color": "#1f61be", "ls": "--" if trial.change.out else "-."}
        label = who(trial)
    elif named:
        before = sum(line.get_gid() == "named" for line in ax.lines)
        color = draw.paler(CULPRIT, 0.3 * min(before, 2))  # one is told from the next
        style |= {"color": tuple(c / 255.0 for c in color), "lw": 2.2, "gid": "named"}
    elif trial.kind == "group":
        style["color"] = "#b06a00"
    else:
        style = {"color": "#a8adb8", "lw": 0.9}
        others = "others, one at a time"
        label = "_" if others in ax.get_legend_handles_labels()[1] else others
    ax.plot(times[rows], errors, label=label, **style)
