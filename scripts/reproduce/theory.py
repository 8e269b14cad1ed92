# SPDX-License-Identifier: Apache-2.0
"""Sections 3.1 to 3.4: what the paper claims of its network, measured on ours."""

from __future__ import annotations

from typing import Any

import numpy as np

from scripts.accuracy import thinned
from scripts.figures import styled
from scripts.reproduce import theory_data
from scripts.reproduce.report import Report, new_figure
from scripts.reproduce.runs import FIRST_SEED, Plan
from sim.simulation import stream
from slam import se2
from slam.frames import Float, Frame
from slam.points import PointWorld, PointWorldConfig
from slam.shunting.config import ShuntingConfig
from slam.shunting.featured import FeaturedShuntingSlam
from slam.shunting.impressions import from_features, from_scan
from slam.shunting.slam import ShuntingSlam
from slam.shunting.stamping import stamp

RED, BLUE, GREEN, GREY = "#ce2c3c", "#1f61be", "#168c5a", "#5b6472"
STRIDE = 5


@styled()
def reproduce(plan: Plan) -> None:
    """All figures of the theory, and their numbers."""
    report = Report("theory", plan)
    scale = plan.scale if plan.quick else 1.0
    seconds = max(2.0, (6.0 if plan.quick else 60.0) * scale)
    office = thinned(list(stream("office", seed=FIRST_SEED, dynamism=0.5, seconds=seconds)), STRIDE)
    steps = max(15, int((60 if plan.quick else 220) * scale))
    points = list(PointWorld(PointWorldConfig(n_steps=steps), seed=FIRST_SEED).stream())
    _lyapunov(report, office, points)
    _scaling(report, office[0], (1, 10, 100) if plan.quick else (1, 3, 10, 30, 100, 300, 1000))
    _growth(report, office, points)
    _bell(report)
    _colours(report)
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
    cases: list[tuple[str, ShuntingSlam, list[Frame], str]] = [
        ("beams, robust, 3 cm", ShuntingSlam(), office, RED),
        ("beams, paper preset, 10 cm", ShuntingSlam(ShuntingConfig.paper(cell_m=0.1)), office,
         BLUE),
        ("points, robust, 3 cm",
         FeaturedShuntingSlam(cell_m=0.03, range_m=12.5, freeze_below=0.0), points, GREEN),
        ("points, paper preset, 10 cm",
         FeaturedShuntingSlam("paper", cell_m=0.1, range_m=12.5), points, GREY),
    ]  # fmt: skip
    figure, axes = new_figure(7.5, 4.2)
    rows = []
    for name, slam, frames, color in cases:
        area, neurons = theory_data.growth(slam, frames, every=2)
        axes[0].plot(area, neurons, "-", color=color, label=name)
        below = "yes" if neurons.max() < 1000 else "**no**"
        rows.append([name, f"{area[-1]:.0f}", f"{neurons.max():.0f}", below])
    axes[0].axhline(1000.0, color="black", ls=":", lw=1.0, label="the paper's bound")
    axes[0].set(yscale="log", xlabel="area explored in m²", ylabel="neurons alive")
    axes[0].legend(frameon=False, fontsize=8)
    report.heading("Neurons stored (3.4: “n is always less than one thousand”)")
    report.table(["", "explored, m²", "neurons, most", "below 1000"], rows, quote=True)
    report.figure("neurons", figure, "Neurons alive against the area explored")


def _bell(report: Report) -> None:
    offsets, sections = theory_data.bell((1, 3, 10, 30, 100))
    figure, axes = new_figure(7.0, 4.0)
    for k, section in sections.items():
        axes[0].plot(offsets, section, "o-", ms=3, label=f"{k} inspirations")
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


def _colours(report: Report) -> None:
    rng = np.random.default_rng(0)
    inputs = np.where(rng.uniform(size=(24, 24)) < 0.1, rng.uniform(size=(24, 24)), 0.0)
    config = ShuntingConfig.paper()
    start = rng.uniform(0.0, 0.5, inputs.shape)
    one, four = theory_data.two_sweeps(inputs, start, config, sweeps=60, step=0.5)
    apart = [float(np.abs(a - b).max()) for a, b in zip(one, four, strict=True)]
    left = [[float(np.abs(x - run[-1]).max()) for x in run[:-1]] for run in (one, four)]
    figure, axes = new_figure(7.0, 4.0)
    axes[0].plot(left[0], color=RED, label="neuron by neuron, from its end")
    axes[0].plot(left[1], "--", color=BLUE, label="four colours, from its end")
    axes[0].plot(apart, color=GREY, label="one from the other")
    axes[0].set(yscale="log", xlabel="sweeps", ylabel="largest difference of an activity")
    axes[0].legend(frameon=False)
    report.heading("Multi-colour Gauss-Seidel (3.4)")
    report.say(
        f"After 60 sweeps both orders are {apart[-1]:.1e} apart: one fixed point. SLAM takes one "
        "sweep a scan; the library sweeps in order and uses no threads."
    )
    report.figure("colours", figure, "Sequential and multi-colour sweeps")


def _overlap(report: Report, points: list[Frame]) -> None:
    """Fig. 5 from a real update: map before a frame, the frame's input, and what they share."""
    slam = FeaturedShuntingSlam(cell_m=0.05, range_m=12.5, freeze_below=0.0)
    frames = points[: min(12, len(points))]
    for frame in frames[:-1]:
        slam.update(frame.without_truth())
    features = frames[-1].features
    assert features is not None
    seen = from_features(features, slam.config)
    # as the odometry alone would put it: some centimetres off
    step = se2.between(frames[-2].odometry.T_odom_robot, frames[-1].odometry.T_odom_robot)
    pose = se2.compose(slam.trajectory().poses[-1], step)
    near = int(np.argmin(np.hypot(*features.points_robot.T)))
    at = se2.transform(pose, features.points_robot[near])
    stamp(slam.network, seen, pose)
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
    activity = np.maximum(y, x / slam.config.saturation)
    report.heading("The overlap of Fig. 5")
    report.figure("fig5", fig5(activity, given, (i0, j0), cell), "Fig. 5: from a real update")


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
    axes[1].set(title="(b) what they share")
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
