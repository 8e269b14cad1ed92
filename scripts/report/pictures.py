# SPDX-License-Identifier: Apache-2.0
"""Pictures of single runs: maps beside the truth, error over time, a strip of moments."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D

from scenes.kinds import is_door
from scripts import figures
from scripts.comparison.run_file import RunFile
from scripts.figures import COLORS, SVG, color_of, styled, svg
from scripts.metrics.judged import in_first_frame
from slam import se2
from slam.evaluation.lost import LOST_M
from slam.frames import Float
from slam.system import Raster
from slam.trajectory import Trajectory

MOMENTS = 8
AROUND_M = 3.0  # of the paths, in the strip
MOVING, RESTING, SCAN, TRUTH = "#e0902c", "#c3c7ce", "#1f61be", COLORS["truth"]
_PANEL = 2.9  # inches
_INK = np.array([22.0, 33.0, 58.0]) / 255.0
_COLORS = ListedColormap(
    [(1.0 - share * (1.0 - _INK)).tolist() for share in np.linspace(0.0, 1.0, 64)]
).with_extremes(bad="#e6e8eb")


@styled(SVG)
def map_panels(run: RunFile, slams: Sequence[str]) -> list[tuple[str, str]]:
    """(title, SVG): the room as it was at the end, then the last map of each SLAM that has one."""
    figure, ax = _panel(run)
    _image(ax, run.static_map)
    _movers(ax, run, len(run.truth) - 1)
    ax.plot(run.truth[:, 0], run.truth[:, 1], color=TRUTH, lw=1.1)
    panels = [("truth", svg(figure, "the room at the end of the run, from above"))]
    for slam in slams:
        believed = run.believed(slam)
        if believed.map is None:
            continue
        figure, ax = _panel(run)
        poses = _in_world(run, believed.poses)
        _image(ax, believed.map, run.truth[0])
        ax.plot(poses[:, 0], poses[:, 1], color=color_of(slam, slams), lw=1.1)
        panels.append((slam, svg(figure, f"the last map of {slam}")))
    return panels


@styled(SVG)
def strip(run: RunFile, slam: str, slams: Sequence[str]) -> list[tuple[float, str]]:
    """(second, SVG) at a few moments: the world from above, the true robot and the believed one."""
    believed = run.believed(slam)
    poses = _in_world(run, believed.poses)
    last = max(len(poses) - 1, 0)
    paths = np.vstack([run.truth[:, :2], poses[:, :2]])
    moments = sorted({round(last * k / (MOMENTS - 1)) for k in range(MOMENTS)})
    panels = []
    for k in moments:
        second = float(run.stamps_ns[k] - run.stamps_ns[0]) / 1e9
        figure, ax = _panel(run, paths)
        _image(ax, run.static_map)
        _movers(ax, run, k)
        ax.plot(run.truth[: k + 1, 0], run.truth[: k + 1, 1], color=TRUTH, lw=0.9)
        _robot(ax, run.truth[k], TRUTH)
        if k < len(poses):
            color = color_of(slam, slams)
            points = _scan(run, k, poses[k])
            ax.plot(points[:, 0], points[:, 1], ".", color=SCAN, ms=2.4, mew=0, zorder=4)
            ax.plot(poses[: k + 1, 0], poses[: k + 1, 1], color=color, lw=0.9)
            _robot(ax, poses[k], color, filled=False)
        panels.append((second, svg(figure, f"the world after {second:.1f} s")))
    return panels


@styled(SVG)
def errors(run: RunFile, slams: Sequence[str]) -> str:
    """SVG: position error over time for every SLAM; below it what share of the beams met movers."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    truth = in_first_frame(Trajectory(stamps_ns=run.stamps_ns, poses=run.truth))
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3.2, 1.0))
    for slam in slams:
        said = run.believed(slam)
        if len(said.stamps_ns) == 0:
            continue
        track = Trajectory(stamps_ns=said.stamps_ns, poses=said.poses)
        seconds, offset, _ = figures.error_series(track, truth)
        color = color_of(slam, slams)
        above.plot(seconds, offset * 100.0, color=color, lw=1.4)
        if len(said.stamps_ns) < len(run.stamps_ns):  # it failed there
            above.plot(seconds[-1], offset[-1] * 100.0, "x", color=color, ms=8, mew=2)
    above.axhline(LOST_M * 100.0, color=figures.MUTED, lw=0.8, ls=":")
    figures.remark(above, LOST_M * 100.0, "lost", figures.MUTED)
    figures.log_axis(above)
    above.set_ylabel("position error, cm")
    seconds = (run.stamps_ns - run.stamps_ns[0]) / 1e9
    below.fill_between(seconds, moving_share(run) * 100.0, color=MOVING, alpha=0.55, lw=0)
    below.set(xlabel="time, s", ylabel="moving, %", ylim=(0.0, None))
    below.margins(x=0.01)
    return svg(figure, "position error over time, and the share of beams on moving things")


def moving_share(run: RunFile) -> Float:
    """(n,) of the beams of each scan that met something, those that met a thing in motion."""
    met = run.hit >= -1
    mover = run.hit >= 0
    rows = np.broadcast_to(np.arange(len(run.hit))[:, None], run.hit.shape)
    moving = np.zeros(run.hit.shape, dtype=np.bool_)
    moving[mover] = run.moving[rows[mover], run.hit[mover]]
    share: Float = moving.sum(axis=1) / np.maximum(met.sum(axis=1), 1)
    return share


def _panel(run: RunFile, paths: Float | None = None) -> tuple[Figure, Axes]:
    """Axes in the world: the room, or the part of it around ``paths`` (n, 2)."""
    room = run.static_map
    low = room.T_map_origin[:2]
    high = low + np.array(room.values.shape[::-1]) * room.resolution_m
    if paths is not None:
        near = np.maximum(low, paths.min(axis=0) - AROUND_M)
        far = np.minimum(high, paths.max(axis=0) + AROUND_M)
        if (near < far).all():  # else the whole of both is outside the room
            low, high = near, far
    (x, y), (width, height) = low.tolist(), (high - low).tolist()
    shape = min(max(height / width, 0.4), 1.6)
    figure = Figure(figsize=(_PANEL, _PANEL * shape))
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set(xlim=(x, x + width), ylim=(y, y + height), aspect="equal", xticks=[], yticks=[])
    ax.grid(visible=False)
    ax.set_facecolor("#e6e8eb")
    for spine in ax.spines.values():
        spine.set_visible(False)
    meters = 10.0 ** math.floor(math.log10(width / 3.0))
    at = (x + 0.06 * width, y + 0.06 * height)
    rim = [withStroke(linewidth=2.0, foreground="white")]  # a box would hide what is there
    ax.plot([at[0], at[0] + meters], [at[1], at[1]], color=figures.INK, lw=2.0, zorder=6,
            path_effects=rim)  # fmt: skip
    ax.annotate(f"{meters:g} m", at, xytext=(0, 4), textcoords="offset points", fontsize=9,
                zorder=6, path_effects=rim)  # fmt: skip
    return figure, ax


def _image(ax: Axes, raster: Raster, T_world_map: Float | None = None) -> None:
    """A raster in the world; cells stay cells however it is turned."""
    height, width = (n * raster.resolution_m for n in raster.values.shape)
    T = raster.T_map_origin
    if T_world_map is not None:
        T = se2.compose(T_world_map, T)
    place = Affine2D().rotate(float(T[2])).translate(float(T[0]), float(T[1]))
    image: Any = ax.imshow(raster.values, origin="lower", extent=(0.0, width, 0.0, height),
                           cmap=_COLORS, vmin=0.0, vmax=1.0, interpolation="none",
                           aspect="auto")  # fmt: skip
    limits = ax.get_xlim(), ax.get_ylim()
    image.set_transform(place + ax.transData)
    ax.set(xlim=limits[0], ylim=limits[1], aspect="equal")


def _movers(ax: Axes, run: RunFile, k: int) -> None:
    """Discs where things are at scan k, doors as their leaves; amber what moves."""
    for m, (x, y, theta) in enumerate(run.mover_poses[k].tolist()):
        if run.kinds[m] == "robot":
            continue
        color = MOVING if run.moving[k, m] else RESTING
        radius = float(run.radii_m[m])
        if is_door(run.kinds[m]):
            tip = (x + radius * math.cos(theta), y + radius * math.sin(theta))
            ax.plot([x, tip[0]], [y, tip[1]], color=color, lw=2.4, solid_capstyle="round")
        else:
            ax.add_patch(Circle((x, y), radius, facecolor=color, edgecolor="none", zorder=2))


def _robot(ax: Axes, pose: Float, color: str, *, filled: bool = True) -> None:
    """A triangle; the believed one is an outline, so that the true one shows through."""
    body = se2.transform(pose, np.array([[0.4, 0.0], [-0.28, 0.26], [-0.28, -0.26]]))
    face, edge = (color, "white") if filled else ("none", color)
    ax.fill(body[:, 0], body[:, 1], facecolor=face, edgecolor=edge, lw=1.4, zorder=5)


def _in_world(run: RunFile, poses: Float) -> Float:
    """Believed poses as drawn over the world: the map frame is the true first pose."""
    turned = [se2.compose(run.truth[0], pose) for pose in poses]
    return np.array(turned).reshape(-1, 3)


def _scan(run: RunFile, k: int, T_world_robot: Float) -> Float:
    """(m, 2) end points of scan k where the robot believes itself to be."""
    ranges = run.ranges[k].astype(np.float64)
    seen = np.isfinite(ranges) & (ranges < run.laser_range_max)
    angles = run.laser_angles[seen]
    points = np.stack([ranges[seen] * np.cos(angles), ranges[seen] * np.sin(angles)], axis=1)
    return se2.transform(se2.compose(T_world_robot, run.T_robot_laser), points)
