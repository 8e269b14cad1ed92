# SPDX-License-Identifier: Apache-2.0
"""Sections 3.1 to 3.4: what the paper claims of its network's cost and overlap, measured on ours.

What it claims of single neurons is held by ``tests/slam/shunting/map`` and
``tests/slam/tracker/test_network.py``.
"""

import time
from collections.abc import Sequence
from itertools import accumulate, count, islice, pairwise
from typing import Any

import numpy as np

from scripts.figures import styled
from scripts.paper.landmarks import PAPER_SHARE
from scripts.paper.point_runs import SHUNTING
from scripts.paper.report import Report, new_figure
from scripts.paper.runs import FIRST_SEED, Plan
from sim.core.dynamism import Dynamism
from sim.simulation import stream
from slam import se2
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Float, Frame
from slam.frontend.observations import Observations, from_features, from_scan
from slam.frontend.odometry_steps import thinned
from slam.shunting.featured import FeaturedShuntingSlam
from slam.shunting.slam import ShuntingConfig, ShuntingSlam
from slam.tracker.cells import SIDE, Look, living
from slam.tracker.matching.matcher import Matcher
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise

RED, BLUE, GREEN, GREY = "#ce2c3c", "#1f61be", "#168c5a", "#5b6472"
STRIDE = 5
PITCH_M = 20.0
EVERY_S = 0.2  # between inspirations


@styled()
def reproduce(plan: Plan) -> None:
    """All figures of the theory, and their numbers."""
    report = Report("theory", plan)
    seconds = 4.0 if plan.quick else 60.0
    rates = Dynamism.world_1(0.5)
    driven = list(stream("office", seed=FIRST_SEED, dynamism=rates, seconds=seconds))
    office = thinned(driven, STRIDE)
    steps = 60 if plan.quick else 220
    world = PointWorldConfig(moving=PAPER_SHARE, n_steps=steps)
    points = list(PointWorld(world, seed=FIRST_SEED).stream())
    _scaling(report, office[0], (1, 10, 100) if plan.quick else (1, 3, 10, 30, 100, 300, 1000))
    _growth(report, office, points)
    _overlap(report, points)
    report.finish("Theory (paper: sections 3.1 to 3.4, Fig. 5)")


def _scaling(report: Report, frame: Frame, rooms: tuple[int, ...]) -> None:
    rows = scaling(frame, rooms)
    area, alive, visited, update_ms, match_ms = zip(*rows, strict=True)
    figure, axes = new_figure(9.0, 3.8, columns=2)
    axes[0].plot(area, update_ms, "o-", color=RED, label="update of the network")
    axes[0].plot(area, match_ms, "s-", color=BLUE, label="matching")
    axes[0].set(xscale="log", xlabel="area of the map in m²", ylabel="CPU in ms", ylim=(0, None))
    axes[1].plot(area, alive, "o-", color=GREY, label="alive in the map")
    axes[1].plot(area, visited, "o-", color=RED, label="visited by an update")
    axes[1].set(xscale="log", yscale="log", xlabel="area of the map in m²", ylabel="neurons")
    for ax in axes:
        ax.legend(frameon=False)
    report.heading("Time against the size of the map (3.4)")
    head = ["area, m²", "neurons alive", "visited", "update, ms", "matching, ms"]
    cells = ([f"{a:.0f}", str(n), str(v), f"{u:.2f}", f"{m:.2f}"] for a, n, v, u, m in rows)
    report.table(head, cells, quote=True)
    same = "the same at every size" if len(set(visited)) == 1 else "**not the same**"
    report.say(
        f"Neurons visited: {same}. Times are medians of process time; the largest over the "
        f"smallest is {max(update_ms) / min(update_ms):.2f} for the update and "
        f"{max(match_ms) / min(match_ms):.2f} for matching.",
        quote=True,
    )
    report.figure("scaling", figure, "One scan in maps of ever more area")


def _growth(report: Report, office: list[Frame], points: list[Frame]) -> None:
    """Neurons stored while more is explored."""
    moving = f"{PAPER_SHARE:.0%} moving"
    cases: list[tuple[str, ShuntingSlam, list[Frame], str]] = [
        ("beams, robust, 3 cm", ShuntingSlam(), office, RED),
        ("beams, paper preset, 10 cm", ShuntingSlam(ShuntingConfig.paper(cell_m=0.1)), office,
         BLUE),
        (f"points, {moving}, as in 4.2, {100.0 * SHUNTING['cell_m']:g} cm",
         FeaturedShuntingSlam(**SHUNTING), points, GREEN),
        (f"points, {moving}, paper preset, 10 cm",
         FeaturedShuntingSlam("paper", cell_m=0.1, range_m=12.5), points, GREY),
    ]  # fmt: skip
    figure, axes = new_figure(7.5, 4.2)
    rows = []
    for name, slam, frames, color in cases:
        area, neurons = growth(slam, frames, every=2)
        axes[0].plot(area, neurons, "-", color=color, label=name)
        past = np.flatnonzero(neurons >= 1000)
        where = f"**{area[past[0]]:.0f}**" if len(past) else "never"
        rows.append([name, f"{area[-1]:.0f}", f"{neurons.max():.0f}", where])
    axes[0].axhline(1000.0, color="black", ls=":", lw=1.0, label="the paper's bound")
    axes[0].set(xscale="log", yscale="log", xlabel="area explored in m²", ylabel="neurons alive")
    axes[0].legend(frameon=False, fontsize=8)
    report.heading("Neurons stored (3.4: “n is always less than one thousand”)")
    head = ["", "explored, m²", "neurons, most", "1000 reached at, m²"]
    report.table(head, rows, quote=True)
    report.figure("neurons", figure, "Neurons alive against the area explored")


def _overlap(report: Report, points: list[Frame]) -> None:
    """Fig. 5 from a real update: map before a frame, the frame's input, and what they share."""
    slam = FeaturedShuntingSlam(cell_m=0.05, range_m=12.5, carried_per_h=0.0)
    slam.update(points[0].without_truth())
    for before, frame in pairwise(points):
        activity, given, corner = _about_nearest(slam, before, frame)
        if np.minimum(activity, given).max() > 0.3:
            break
        slam.network.release()
        slam.update(frame.without_truth())
    report.heading("The overlap of Fig. 5")
    report.say(
        "About the nearest point of a frame, where the odometry alone puts it, before matching: "
        "the first frame in which this is near enough for an overlap."
    )
    figure = fig5(activity, given, corner, slam.config.cell_m)
    report.figure("fig5", figure, "Fig. 5: from a real update")


def _about_nearest(
    slam: ShuntingSlam, before: Frame, frame: Frame
) -> tuple[Float, Float, tuple[int, int]]:
    """Activity, input and first neuron of a square about the nearest feature of ``frame``; its
    impressions stay on the network."""
    features = frame.features
    assert features is not None
    step = se2.between(before.odometry.T_odom_robot, frame.odometry.T_odom_robot)
    pose = se2.compose(slam.trajectory().poses[-1], step)
    nearest = int(np.argmin(np.hypot(*features.points_robot.T)))
    at = se2.transform(pose, features.points_robot[nearest])
    rasterise(slam.network, from_features(features, slam.config), pose)
    cell, reach = slam.config.cell_m, 6
    i0, j0 = (int(np.floor(v / cell)) - reach for v in at)
    size = 2 * reach + 1
    low, high = (np.array([i0, j0]) + 0.5) * cell, (np.array([i0, j0]) + size - 0.5) * cell
    x, y = slam.window(low[0], low[1], high[0], high[1])
    whole = slam.network.extent()
    assert whole is not None
    shape = (whole[3] - whole[1], whole[2] - whole[0])
    inputs = inputs_of(slam.network, shape, whole[0], whole[1])
    given = inputs[j0 - whole[1] :, i0 - whole[0] :][:size, :size]
    return np.maximum(y, x / slam.config.saturation), given, (i0, j0)


def fig5(activity: Float, given: Float, corner: tuple[int, int], cell: float) -> Any:
    """(a) activities grey and input coloured, (b) their overlap, (c) a section through both."""
    figure, axes = new_figure(13.0, 4.2, columns=3)
    i0, j0 = corner
    rows, columns = activity.shape
    extent = (i0 * cell, (i0 + columns) * cell, j0 * cell, (j0 + rows) * cell)
    x = (i0 + np.arange(columns) + 0.5) * cell
    y = (j0 + np.arange(rows) + 0.5) * cell
    axes[0].imshow(activity, origin="lower", extent=extent, cmap="Greys", vmin=0.0, vmax=1.0)
    axes[0].contour(x, y, given, levels=[0.1, 0.3, 0.5, 0.7, 0.9], cmap="YlOrRd")
    axes[0].set(title="(a) activities (grey), input (contours)")
    shared = np.minimum(activity, given)
    image = axes[1].imshow(shared, origin="lower", extent=extent, cmap="YlOrRd", vmin=0.0, vmax=1.0)
    axes[1].set(title="(b) overlap of both")
    figure.colorbar(image, ax=axes[1], shrink=0.7)
    for ax in axes[:2]:
        ax.grid(visible=False)
        ax.set(xlabel="x in m", ylabel="y in m")
    row = int(np.argmax(shared.max(axis=1)))
    axes[2].plot(x, activity[row], "o-", color=GREY, ms=3, label="activity")
    axes[2].plot(x, given[row], "s-", color=RED, ms=3, label="input")
    axes[2].fill_between(x, shared[row], color="#de6e18", alpha=0.4, label="overlap")
    axes[2].set(
        xlabel="x in m", ylabel="activity, input", title=f"(c) section at y = {y[row]:.2f} m"
    )
    axes[2].legend(frameon=False, fontsize=8)
    return figure


Scaled = tuple[float, int, int, float, float]
"""Map size, m^2; neurons alive; neurons visited by an update; ms of an update and of a match
(medians of process time)."""


def scaling(frame: Frame, rooms: Sequence[int], repeats: int = 15) -> list[Scaled]:
    """The same scan in maps that hold ever more copies of what it shows, ``PITCH_M`` apart."""
    config, origin = ShuntingConfig(range_m=9.0), np.zeros(3)
    assert frame.scan is not None
    seen = from_scan(frame.scan, origin, config)
    matcher, network, found = Matcher(config), Network(config), []
    turns = (1j**turn for turn in count() for _ in range(turn // 2 + 1))
    spiral = accumulate(turns, initial=0j)  # nearest first, so that the first one is the origin
    for before, after in pairwise((0, *rooms)):
        for at in islice(spiral, after - before):
            _look(network, seen, np.array([at.real * PITCH_M, at.imag * PITCH_M, 0.0]))
        spent, visited = np.zeros((repeats, 2)), 0
        for k in range(repeats):
            start = time.process_time()
            visited = _look(network, seen, origin).visited
            middle = time.process_time()
            matcher.climb(network, seen, np.array([0.02, 0.01, 0.01]), origin, np.eye(3))
            spent[k] = middle - start, time.process_time() - middle
        update_ms, match_ms = (1e3 * np.median(spent, axis=0)).tolist()
        found.append((after * PITCH_M**2, alive(network), visited, update_ms, match_ms))
    return found


def _look(network: Network, seen: Observations, pose: Float) -> Look:
    rasterise(network, seen, pose)
    T_map_laser = se2.compose(pose, seen.T_robot_laser)
    return network.integrate(seen.view, T_map_laser, EVERY_S, write=True)


def alive(network: Network) -> int:
    """Neurons that are not silent."""
    slots, _ = living(network.cells)
    return int(((network.cells.x[slots] > 0.0) | (network.cells.y[slots] > 0.0)).sum())


def growth(slam: ShuntingSlam, frames: Sequence[Frame], every: int) -> tuple[Float, Float]:
    """Area explored (m^2, in squares of 1 m) and neurons alive, at every so many frames."""
    explored: set[tuple[int, int]] = set()
    area, neurons = [], []
    for k, frame in enumerate(frames):
        pose = slam.update(frame.without_truth()).T_map_robot
        if k % every:
            continue
        explored.update(map(tuple, np.floor(_free(frame, pose)).astype(int).tolist()))
        area.append(float(len(explored)))
        neurons.append(float(alive(slam.network)))
    return np.array(area), np.array(neurons)


def _free(frame: Frame, pose: Float) -> Float:
    """(n, 2) places seen: along the beams, or the half disc of a sensor of features."""
    if frame.scan is not None:
        ranges = np.where(frame.scan.valid, frame.scan.ranges, 0.0)
        angles, T = frame.scan.spec.angles, se2.compose(pose, frame.scan.spec.T_robot_laser)
    else:
        ranges, angles, T = np.full(91, 12.0), np.linspace(-1.57, 1.57, 91), pose
    share = np.arange(0.0, 1.0, 0.04)[:, None]
    r = share * ranges[None, :]
    points = np.stack([r * np.cos(angles), r * np.sin(angles)], axis=-1).reshape(-1, 2)
    return se2.transform(T, points)


def inputs_of(network: Network, shape: tuple[int, int], i0: int, j0: int) -> Float:
    """Dense I of the present impressions, neurons (i0 + column, j0 + row)."""
    cells, out = network.cells, np.zeros(shape)
    for slot, place in zip(*living(cells), strict=True):
        if (scratch := cells.scratch_of[slot]) >= 0:
            i, j = place * SIDE - (i0, j0)
            out[j : j + SIDE, i : i + SIDE] = cells.impression[scratch]
    return out
