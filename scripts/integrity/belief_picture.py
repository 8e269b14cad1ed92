# SPDX-License-Identifier: Apache-2.0
"""What the SLAM believes over time, in three runs: ``python -m scripts.integrity.belief_picture``.

Boards close in, the robot is carried elsewhere, and a room was changed out of sight. Above are the
probabilities of where motion led, of places nearby, of places elsewhere, and of carried to nobody
knows where; below is the true error of the pose. Streams are training seeds of the plane.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.console import ended
from scripts.figures import COLORS, save, styled
from scripts.integrity.kidnap import kidnapped, targets
from scripts.integrity.labelled import off
from scripts.integrity.plane import StreamSpec, frames
from scripts.integrity.reliability import believed
from slam import se2
from slam.frames import NS_PER_S, Float, Frame
from slam.shunting import ShuntingSlam

PICTURE = Path("docs/pictures/belief.png")
LEAST = 1e-6  # probability at the foot of the axis
FROZEN = "#59616e"
LOOKS = (  # as ``reliability.MOTION`` to ``UNKNOWN`` count them
    ("where motion led", COLORS["truth"], "-"),
    ("nearby: a slip", "#1f61be", (0, (1, 1))),
    ("elsewhere in the map", COLORS["shunting"], "--"),
    ("carried, place unknown", "#7a3fb0", "-."),
)
CARRIED_S = 8.0  # followed after a kidnap
BESIDE_S = 1.0  # shown before and after
RIGHT_M = 0.3
COURSE = np.dtype([("seconds", "f8"), ("shares", "f8", (4,)), ("error_m", "f8"), ("written", "?")])
"""A scan: probabilities as in ``LOOKS``, whether the map was written."""
Course = np.ndarray
CARRIED = "carried at 60 s"
PANELS = {
    "boards close in": StreamSpec(kind="pass10", seed=3, seconds=75.0),
    CARRIED: StreamSpec(kind="chairs8", seed=4, seconds=60.0),
    "a room changed out of sight": StreamSpec(kind="moved30_calm", seed=2, seconds=75.0),
}
"""The stream under each title; in the second the robot is carried at its end."""


def shown(title: str) -> Iterable[Frame]:
    """All of a panel from the beginning of the stream."""
    spec = PANELS[title]
    stream = frames(spec)
    if title != CARRIED:
        return stream
    later = frames(replace(spec, again=1))
    scans = round(CARRIED_S * spec.settings.rate_hz)
    return chain(stream, kidnapped(stream, later, next(targets(stream, later, scans, 1)), scans))


def followed(stream: Iterable[Frame]) -> Course:
    """(n,) of ``COURSE``: what the SLAM believes scan by scan."""
    slam, rows = ShuntingSlam(), []
    start: Float | None = None
    first_ns = 0
    for frame in stream:
        assert frame.truth is not None
        if start is None:
            start, first_ns = frame.truth, frame.stamp_ns
        seconds = (frame.stamp_ns - first_ns) / NS_PER_S
        estimate = slam.update(frame.without_truth())
        error_m, _ = off(estimate.T_map_robot, se2.between(start, frame.truth))
        written = estimate.diagnostics["state"] == "tracking"
        rows.append((seconds, shares(slam), error_m, written))
    return np.array(rows, dtype=COURSE)


def shares(slam: ShuntingSlam) -> list[float]:
    """Probabilities as in ``LOOKS`` after the latest scan."""
    found = believed(slam)
    if not found:
        return [1.0 - slam._belief.p_lost, 0.0, 0.0, slam._belief.p_lost]
    return [sum((one.p for one in found if one.what == what), 0.0) for what in range(len(LOOKS))]


def window(course: Course) -> tuple[float, float]:
    """Seconds about the longest time that the map was not written and the pose came right again.

    About the scan at which motion was believed least, where it was always written.
    """
    seconds, frozen = course["seconds"], np.concatenate([[False], ~course["written"], [False]])
    edges = np.flatnonzero(frozen[1:] != frozen[:-1])
    begins, ends = edges[::2], np.minimum(edges[1::2], len(course) - 1)
    right = course["error_m"][ends] < RIGHT_M
    at = np.argmin(course["shares"][:, 0]), np.argmin(course["shares"][:, 0])
    if right.any():
        longest = np.argmax(np.where(right, ends - begins, -1))
        at = begins[longest], ends[longest]
    return float(seconds[at[0]]) - BESIDE_S, float(seconds[at[1]]) + BESIDE_S


@styled()
def picture(path: Path) -> None:
    """Run all, and draw them side by side."""
    figure = Figure(figsize=(11.0, 5.4))
    axes = figure.subplots(2, len(PANELS), sharex="col", sharey="row", squeeze=False,
                           height_ratios=(2.2, 1.0))  # fmt: skip
    for column, title in enumerate(PANELS):
        _draw(axes[0, column], axes[1, column], followed(shown(title)))
        axes[0, column].set_title(title)
    axes[0, 0].set_ylabel("probability [1]")
    axes[1, 0].set_ylabel("error of the pose [m]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    save(figure, path)


def _draw(above: Axes, below: Axes, course: Course) -> None:
    begin_s, end_s = window(course)
    course = course[(course["seconds"] >= begin_s) & (course["seconds"] <= end_s)]
    seconds, error_m = course["seconds"], np.maximum(course["error_m"], 1e-3)
    for (name, tint, dashes), p in zip(LOOKS, course["shares"].T, strict=True):
        p = np.maximum(p, 0.5 * LEAST)
        above.step(seconds, p, where="post", color=tint, ls=dashes, lw=1.5, label=name)
    for ax in (above, below):
        ax.fill_between(
            seconds, 0.0, 1.0, where=~course["written"], step="post", color=FROZEN, alpha=0.15,
            lw=0, transform=ax.get_xaxis_transform(), label="map not written",
        )  # fmt: skip
        ax.margins(x=0.0)
        ax.set_yscale("log")
    above.set_ylim(LEAST, 1.5)
    below.step(seconds, error_m, where="post", color="#20242c", lw=1.2)
    below.set_ylim(1e-3, 20.0)
    below.set_xlabel("time [s]")


@ended
def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=PICTURE)
    wanted = parser.parse_args(arguments)
    picture(wanted.out)
    print(f"wrote {wanted.out}")


if __name__ == "__main__":
    sys.exit(main())
