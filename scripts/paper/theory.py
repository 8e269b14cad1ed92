# SPDX-License-Identifier: Apache-2.0
"""Sections 3.1 to 3.4: what the paper claims of its network, measured on ours."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from scripts.figures import styled
from scripts.paper import theory_data
from scripts.paper.landmarks import PAPER_SHARE
from scripts.paper.point_runs import SHUNTING
from scripts.paper.report import Report, new_figure
from scripts.paper.runs import FIRST_SEED, Plan
from sim.core.dynamism import Dynamism
from sim.simulation import stream
from slam import se2
from slam.evaluation.points import PointWorld, PointWorldConfig
from slam.frames import Float, Frame
from slam.frontend.observations import from_features, from_scan
from slam.frontend.odometry_steps import thinned
from slam.shunting.config import ShuntingConfig
from slam.shunting.featured import FeaturedShuntingSlam
from slam.shunting.slam import ShuntingSlam
from slam.tracker.rasterise import rasterise

RED, BLUE, GREEN, GREY = "#ce2c3c", "#1f61be", "#168c5a", "#5b6472"
STRIDE = 5


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
    _lyapunov(report, office, points)
    _scaling(report, office[0], (1, 10, 100) if plan.quick else (1, 3, 10, 30, 100, 300, 1000))
    _growth(report, office, points)
    _bell(report)
    _colours(report, points)
    _overlap(report, points)
    report.finish("Theory (paper: sections 3.1 to 3.4, Fig. 5)")


def _lyapunov(report: Report, office: list[Frame], points: list[Frame]) -> None:
    """V along sweeps under the fixed input of a real frame, in the map of the frames before."""
    figure, axes = new_figure(9.0, 3.8, columns=2)
    rows = []
    for ax, name, frames in zip(axes, ("beams", "features"), (office, points), strict=True):
        make: Any = ShuntingSlam if name == "beams" else FeaturedShuntingSlam
        slam = make(ShuntingConfig.paper(cell_m=0.05))
        for frame in frames[:8]:
            pose = slam.update(frame.without_truth()).T_map_robot
        frame = frames[min(8, len(frames) - 1)]
        if frame.scan is not None:
            seen = from_scan(frame.scan, np.zeros(3), slam.config)
        else:
            assert frame.features is not None
            seen = from_features(frame.features, slam.config)
        values, changes = theory_data.lyapunov(slam, seen, pose, sweeps=40, step=0.2)
        rise = float(np.diff(values).max())
        rows.append([name, f"{values[0]:.4f}", f"{values[-1]:.4f}", f"{rise:.1e}",
                     f"{changes[-1]:.1e}"])  # fmt: skip
        ax.plot(values, "o-", color=RED, ms=3)
        ax.set(xlabel="sweeps under the same input", title=f"{name}, paper preset")
    axes[0].set(ylabel="V of Eq. (10)")
    report.heading("Stability (3.2)")
    report.say(
        "V while one real frame is given again and again to the map of the frames before it. The "
        "proof is about a fixed input: it says that an update settles, nothing about SLAM, where "
        "poses feed back into the input. The network itself works in 32 bit."
    )
    head = ["", "V at first", "V in the end", "largest rise in a sweep", "last change of x"]
    report.table(head, rows)
    report.figure("lyapunov", figure, "V never rises beyond rounding")


def _scaling(report: Report, frame: Frame, rooms: tuple[int, ...]) -> None:
    s = theory_data.scaling(frame, rooms)
    figure, axes = new_figure(9.0, 3.8, columns=2)
    axes[0].plot(s.area, s.update_ms, "o-", color=RED, label="update of the network")
    axes[0].plot(s.area, s.match_ms, "s-", color=BLUE, label="matching")
    axes[0].set(xscale="log", xlabel="area of the map in m²", ylabel="CPU in ms", ylim=(0, None))
    axes[1].plot(s.area, s.alive, "o-", color=GREY, label="alive in the map")
    axes[1].plot(s.area, s.visited, "o-", color=RED, label="visited by an update")
    axes[1].set(xscale="log", yscale="log", xlabel="area of the map in m²", ylabel="neurons")
    for ax in axes:
        ax.legend(frameon=False)
    report.heading("Time against the size of the map (3.4)")
    rows = [
        [f"{a:.0f}", str(n), str(v), f"{u:.2f}", f"{m:.2f}"]
        for a, n, v, u, m in zip(s.area, s.alive, s.visited, s.update_ms, s.match_ms, strict=True)
    ]
    head = ["area, m²", "neurons alive", "visited", "update, ms", "matching, ms"]
    report.table(head, rows, quote=True)
    same = "the same at every size" if len(set(s.visited)) == 1 else "**not the same**"
    report.say(
        f"Neurons visited: {same}. Times are medians of process time; the largest over the "
        f"smallest is {max(s.update_ms) / min(s.update_ms):.2f} for the update and "
        f"{max(s.match_ms) / min(s.match_ms):.2f} for matching.",
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
        area, neurons = theory_data.growth(slam, frames, every=2)
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


def _bell(report: Report) -> None:
    offsets, sections = theory_data.bell((1, 3, 10, 30, 100))
    figure, axes = new_figure(7.0, 4.0)
    for k, section in sections.items():
        last = k == max(sections)  # hides the one before: they converge
        style = {"color": "black", "lw": 1.0, "ls": "--"} if last else {"lw": 2.5, "marker": "o"}
        label = f"{k} inspiration" + ("s" if k > 1 else "")
        axes[0].plot(offsets, section, ms=4, label=label, **style)
    axes[0].set(xlabel="distance from the place in m", ylabel="activity x")
    axes[0].legend(frameon=False)
    report.heading("The bell shape (3.1)")
    whole = all(is_bell(section) for section in sections.values())
    report.say(
        "Inspirations at one place, 5 a second, paper preset (lateral weights on): the activity "
        + ("falls on both sides of its top after each." if whole else "**is no bell.**")
    )
    report.figure("bell", figure, "Activity across a place that is seen again and again")


def is_bell(section: Float) -> bool:
    """Rises to one top, falls after it."""
    top = int(section.argmax())
    rising, falling = np.diff(section[: top + 1]), np.diff(section[top:])
    return bool((rising >= 0.0).all() and (falling <= 0.0).all())


def _colours(report: Report, points: list[Frame]) -> None:
    """The library's sweep, in order, against one that could run on four threads."""
    config = ShuntingConfig.paper(cell_m=0.05)
    features = points[0].features
    assert features is not None
    seen = from_features(features, config)
    one, given = theory_data.library_sweeps(seen, config, sweeps=40, step=0.5)
    four = theory_data.colour_sweeps(given, config, sweeps=40, step=0.5)
    apart = [float(np.abs(a - b).max()) for a, b in zip(one, four, strict=True)][1:]
    left = [[float(np.abs(x - run[-1]).max()) for x in run[1:-1]] for run in (one, four)]
    figure, axes = new_figure(7.0, 4.0)
    sweeps = np.arange(1, 41)
    axes[0].plot(sweeps[:-1], left[0], color=RED, label="the library, in order, from its end")
    axes[0].plot(sweeps[:-1], left[1], "--", color=BLUE, label="four colours, from its end")
    axes[0].plot(sweeps, apart, color=GREY, label="one from the other")
    axes[0].set(yscale="log", xlabel="sweeps", ylabel="largest difference of an activity")
    axes[0].legend(frameon=False)
    report.heading("Multi-colour Gauss-Seidel (3.4)")
    report.say(
        f"The input of a real frame, {int((given > 0.0).sum())} neurons, lateral weights on. After "
        f"the first sweep the library's and one in four colours are {apart[0]:.1e} apart, after 40 "
        f"{apart[-1]:.1e} (the library's network is in 32 bit): one fixed point. SLAM takes one "
        "sweep a scan; the library sweeps in order and uses no threads.",
        quote=True,
    )
    report.figure("colours", figure, "Sequential and multi-colour sweeps")


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
    inputs = theory_data.inputs_of(slam.network, shape, whole[0], whole[1])
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
