# SPDX-License-Identifier: Apache-2.0
"""A search for who is to blame as a whole: the run again, the re-runs, the folder, the picture.

In ``blame.png`` everything stands where it truly is; the scan (red) is drawn where the SLAM
believed it was seen from, so walls and red part company when the SLAM goes astray.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from rich.markup import escape
from rich.progress import Progress

from scenes import groups
from scenes.kinds import is_door
from scripts import interrupt
from scripts.console import note, progress
from scripts.debugger.counterfactual import CURED, Inquest, Trial, hold
from scripts.debugger.question import Question
from scripts.debugger.recording import Case, Strip, Tape, record, simulate
from scripts.debugger.words import as_json, headline, who
from scripts.figures import save, styled
from scripts.output import write_recipe
from scripts.whole_folder import whole_folder
from sim.twins.absence import Change
from sim.view.mapview import FOOT_PX, MapView
from sim.view.scans import beams
from slam import se2
from slam.files import write_text
from slam.frames import NS_PER_S, Float

CULPRIT, TRUTH, BELIEVED, SCAN = "#b020be", "#168c5a", "#1f61be", "#ce2c3c"
MUTED, CURE = "#787e8a", "#168c5a"
PX_PER_M, MOST_PX = 56.0, 8000.0
SIDE_M = (3.5, 9.0)  # least and most of what a cell shows
CELL_IN, CHART_IN = 3.0, 3.2  # inches: width of a cell, height of the chart
MOMENTS = 5
ROOM = 1.8  # of the chart, times the original's greatest error


@styled({"axes.grid": False})
def blame_picture(path: Path, found: Inquest) -> None:
    """Write it."""
    seconds, rows = _moments(found)
    strips = [("as it was", found.tape.strip, rows, Change())]
    # the re-run beside the original: the best cure, else everybody out
    able = [trial for trial in found.trials if not trial.failed]
    shown = next(iter(found.named or found.cures or found.together or able), None)
    if shown is not None:
        later = [row - found.first for row in rows]
        strips.append((who(shown), shown.strip, later, shown.change))
    size = (CELL_IN * len(rows), (CELL_IN + 0.3) * len(strips) + CHART_IN + 0.9)
    figure = Figure(figsize=size, layout="constrained")
    heights = [CELL_IN + 0.3] * len(strips) + [CHART_IN]
    grid = figure.add_gridspec(len(strips) + 1, len(rows), height_ratios=heights)
    case, words = found.tape.case, headline(found)
    below = f"{case.slam} · {case.title}. {words[1]}"
    figure.suptitle(f"{words[0]}\n{below}", fontsize=10, ha="left", x=0.01, wrap=True)
    camera = _Camera(found, rows)
    for line, (name, strip, own, change) in enumerate(strips):
        for column, row in enumerate(own):
            ax = figure.add_subplot(grid[line, column])
            camera.draw(ax, strip, row, own[0], change, rows[column])
            ax.set_title(f"{seconds[column]:.1f} s" + (f", {name}" if column == 0 else ""))
    chart = figure.add_subplot(grid[-1, :])
    _chart(chart, found)
    handles, known = chart.get_legend_handles_labels()
    figure.legend(handles, known, loc="outside lower left", ncols=4, frameon=False, fontsize=8)
    save(figure, path)


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


def _labelled(found: Inquest) -> list[tuple[str, tuple[str, ...]]]:
    """Who the verdict names, or would have, trial by trial, with the word for all of each."""
    trials = [t for t in found.named or found.cures[:1] if t.kind != "all"]
    changes = [trial.change for trial in trials]
    return [(c.called or (c.out or c.frozen)[0], c.out or c.frozen) for c in changes]


class _Camera:
    """Looks at the same square of the floor at all moments."""

    def __init__(self, found: Inquest, rows: Sequence[int]) -> None:
        self._found, self._tape = found, found.tape
        scene = simulate(found.tape.case).world.scene
        a, b, c, d = scene.bounds
        scale = min(PX_PER_M, MOST_PX / max(c - a + 1.0, d - b + 1.0))
        self._view = MapView(scene, *(max(64, round(s * scale)) for s in (c - a + 1, d - b + 1)))
        self._radii = [mover.radius for mover in scene.movers]
        (x0, y0), scale = self._view.to_pixels([[0.0, 0.0]])[0], self._view.scale
        wide, self._rows = self._view.room.shape[1], self._view.room.shape[0] - FOOT_PX
        ends = (-0.5 - x0, wide - 0.5 - x0, y0 - self._rows + 0.5, y0 + 0.5)
        self._extent = tuple(end / scale for end in ends)
        strip = found.tape.strip
        named = [found.tape.names.index(n) for _, names in _labelled(found) for n in names]
        span = range(rows[0], rows[-1] + 1)
        points = [strip.truth[row][:2] for row in span]
        points += [self._world(strip.believed[row])[:2] for row in span]
        points += [strip.poses[row][m][:2] for row in span for m in named]
        low, high_ = np.min(points, axis=0), np.max(points, axis=0)
        most = SIDE_M[1] if found.moment is not None else math.inf  # a good run's whole path
        self._half = 0.5 * min(max(float((high_ - low).max()) + 2.0, SIDE_M[0]), most)
        self._middle = 0.5 * (low + high_)

    def _world(self, T_map_robot: Float) -> Float:
        return se2.compose(self._tape.T_world_map, T_map_robot)

    def draw(
        self, ax: Axes, strip: Strip, row: int, first: int, change: Change, original: int
    ) -> None:
        """A moment of a strip; ``original`` is the row of the tape at that time."""
        tape, poses = self._tape, strip.poses[row].copy()
        poses[[tape.names.index(name) for name in change.out]] = np.nan
        ax.imshow(self._view.draw(poses)[: self._rows], extent=self._extent)
        believed = np.array([self._world(pose) for pose in strip.believed[first : row + 1]])
        truth = np.array(strip.truth[first : row + 1])
        for path, color in ((truth, TRUTH), (believed, BELIEVED)):
            ax.plot(path[:, 0], path[:, 1], color=color, lw=1.5)
        mounted, ends, _ = beams(strip.frames[row])
        hits = se2.transform(se2.compose(believed[-1], mounted), ends)
        ax.plot(hits[:, 0], hits[:, 1], ".", color=SCAN, ms=2.5, mew=0)
        x, y, yaw = believed[-1]
        ax.add_patch(Circle((x, y), 0.3, fill=False, color=BELIEVED, lw=1.5))
        nose = (x + 0.45 * math.cos(yaw), y + 0.45 * math.sin(yaw))
        ax.plot([x, nose[0]], [y, nose[1]], color=BELIEVED, lw=1.5)
        for label, names in _labelled(self._found):
            for name in names:
                gone, m = name in change.out, tape.names.index(name)
                at = tape.strip.poses[original][m] if gone else poses[m]
                self._ring(ax, at, m, gone, label if name == names[0] else "")
        ax.set_xlim(self._middle[0] - self._half, self._middle[0] + self._half)
        ax.set_ylim(self._middle[1] - self._half, self._middle[1] + self._half)
        ax.set_axis_off()
        low = self._middle - 0.93 * self._half
        ax.plot([low[0], low[0] + 1.0], [low[1], low[1]], color="#20242c", lw=2.5)
        ax.text(low[0], low[1] + 0.03 * self._half, "1 m", fontsize=8)

    def _ring(self, ax: Axes, pose: Float, m: int, gone: bool, label: str) -> None:
        """Around somebody named; in dashes where one was who is out."""
        x, y, yaw = pose.tolist()
        radius = self._radii[m] + 0.12
        if is_door(self._tape.kinds[m]):
            half = 0.5 * self._radii[m]
            radius, x, y = half + 0.1, x + half * math.cos(yaw), y + half * math.sin(yaw)
        ring = Circle((x, y), radius, fill=False, color=CULPRIT, lw=1.5, ls=":" if gone else "-")
        ax.add_patch(ring)
        if label:
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.8}
            ax.text(x, y + radius + 0.04, label, color=CULPRIT, weight="bold", fontsize=8,
                    ha="center", va="bottom", clip_on=True, bbox=box)  # fmt: skip


def _chart(ax: Axes, found: Inquest) -> None:
    """Error over time of the original and of every re-run, and what the colours of cells mean."""
    stamps = found.tape.strip.stamps_ns()
    errors = found.tape.strip.errors_m(found.then)
    times = (stamps - stamps[0]) / NS_PER_S
    named = found.named or found.cures[:1]
    for trial in sorted(found.trials, key=lambda t: t in named):
        if not trial.failed:
            _curve(ax, found, trial, times, trial in named)
    last = found.last + 1 if found.moment is not None else len(times)
    ax.plot(times[found.first : last], errors[found.first : last], color="#20242c", lw=2.4,
            label="as it was", zorder=5)  # fmt: skip
    if found.moment is not None:
        for row, word in ((found.moment.begins, "begins "), (found.moment.found, "found ")):
            ax.axvline(times[row], color=MUTED, lw=1.0, ls=":")
            ax.text(times[row], 1.0, word, transform=ax.get_xaxis_transform(), va="top",
                    ha="right", color=MUTED)  # fmt: skip
        if found.trials:
            ax.axhline(CURED * found.rise_m, color=CURE, lw=0.9, ls=(0, (2, 3)),
                       label="below: cured")  # fmt: skip
    what = "error" if found.moment is None else "error since the checkpoint"
    ax.set(
        xlabel="time, s", ylabel=f"{what}, m\n(position + 1 m × heading)",
        xlim=(times[found.first], times[last - 1]),
    )  # fmt: skip
    ax.set_ylim(0.0, ROOM * float(errors[found.first : last].max()))  # a worse one leaves the chart
    for word, color in (
        ("above: truth", TRUTH), ("above: believed", BELIEVED),
        ("above: scan, where it is believed to be", SCAN),
        ("above: who is named (dots: where it was when it is out)", CULPRIT),
    ):  # fmt: skip
        ax.plot([], [], color=color, lw=4.0, label=word)


def _curve(ax: Axes, found: Inquest, trial: Trial, times: Float, named: bool) -> None:
    rows = slice(found.first, found.first + len(trial.strip.frames))
    label, line = who(trial), "-" if trial.change.out else "--"
    style: dict[str, Any] = {"lw": 1.3, "ls": line, "color": BELIEVED}
    if named:
        style |= {"color": CULPRIT, "lw": 2.2}
    elif trial.kind == "group":
        style["color"] = "#b06a00"
    elif trial.kind != "all":
        style = {"color": "#a8adb8", "lw": 0.9}
        others = "others, one at a time"
        label = "_" if others in ax.get_legend_handles_labels()[1] else others
    ax.plot(times[rows], trial.strip.errors_m(found.then), label=label, **style)


AGREES_M = 1e-5  # a trajectory on file is rounded


def carry_out(case: Case, question: Question, folder: Path, *, overwrite: bool) -> Inquest:
    """Find who is to blame and write the folder."""
    recipe = _recipe(case, question)
    with whole_folder(folder, overwrite=overwrite, command="blame", settings=recipe) as part:
        found = _inquest(case, question)
        blame_picture(part / "blame.png", found)
        text = json.dumps(as_json(found), indent=1, allow_nan=False)
        write_text(part / "blame.json", text + "\n")
        write_recipe(part, "blame", recipe)
    return found


def _inquest(case: Case, question: Question) -> Inquest:
    if question.who:  # told before the run
        movers = simulate(case).world.scene.movers
        for word in question.who:
            groups.named(movers, word)
    with progress() as bar:
        tape = record(case, _Bar(bar, "driving").scans)
        _compare(tape)
        return hold(tape, question, _Bar(bar, "re-runs").trials)


class _Bar:
    """One line of the progress."""

    def __init__(self, bar: Progress, words: str) -> None:
        self._bar = bar
        self._task = bar.add_task(words, total=None, unit="")

    def scans(self, done: int, of: int) -> None:
        """Scans of the original."""
        interrupt.check()
        if done % 25 == 0 or done == of:
            self._bar.update(self._task, completed=done, total=of, unit=f"{done}/{of} scans")

    def trials(self, what: str, done: int, of: int) -> None:
        """A re-run begins."""
        interrupt.check()
        words = what if len(what) < 50 else "all movers"
        self._bar.update(self._task, completed=done, total=of, unit=escape(words))


def _compare(tape: Tape) -> None:
    """Say so where the run on file was another one."""
    case = tape.case
    if case.made is not None and case.made.elsewhere():
        note(f"the episode was made elsewhere: {case.made.elsewhere()}")
    recorded, again = case.recorded, np.array(tape.strip.believed)
    if recorded is None:
        return
    if recorded.shape != again.shape:
        note(f"of {case.slam} {len(recorded)} poses are on file, the run again has {len(again)}")
        return
    gap = float(np.abs(recorded[:, :2] - again[:, :2]).max())
    if gap > AGREES_M:
        note(f"run again, {case.slam} is up to {gap:.3g} m elsewhere: other versions or CPU?")


def _recipe(case: Case, question: Question) -> dict[str, Any]:
    """What makes it again."""
    asked = {f"asked_{k}": v for k, v in vars(replace(question)).items() if k != "rule"}
    rule = {f"rule_{k}": v for k, v in vars(question.rule).items()}
    own = {"slam": case.slam, "seconds": case.seconds, "every": case.every}
    return {**own, "simulation": case.settings, **asked, **rule}
