# SPDX-License-Identifier: Apache-2.0
"""What the SLAM believes over time, in three runs: ``python -m scripts.integrity.belief_picture``.

Boards close in, the robot is carried elsewhere, and a room was changed out of sight. Above are the
probabilities of where motion led, of places nearby, of places elsewhere, and of carried to nobody
knows where; below is the true error of the pose. Streams are training seeds of the plane.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.experiments.kidnap import kidnapped, targets
from scripts.experiments.measured import ended
from scripts.figures import COLORS, save, styled
from scripts.integrity.labelled import off
from scripts.integrity.plane import StreamSpec, frames
from slam import se2
from slam.frames import NS_PER_S, Float, Frame
from slam.shunting import ShuntingSlam

PICTURE = Path("docs/pictures/belief.png")
LEAST = 1e-6  # probability at the foot of the axis
FROZEN = "#59616e"
LOOKS = (
    ("where motion led", COLORS["truth"], "-"),
    ("nearby: a slip", "#1f61be", (0, (1, 1))),
    ("elsewhere in the map", COLORS["shunting"], "--"),
    ("carried, place unknown", "#7a3fb0", "-."),
)
CARRIED_S = 8.0  # followed after a kidnap
BESIDE_S = 1.0  # shown before and after
RIGHT_M = 0.3


@dataclass(frozen=True, kw_only=True)
class Panel:
    """``title``, and the stream.

    carried  the robot is carried at the end of the stream, to the how-manieth target
    """

    title: str
    spec: StreamSpec
    carried: int | None = None

    def frames(self) -> Iterable[Frame]:
        """All from the beginning of the stream."""
        stream = frames(self.spec)
        if self.carried is None:
            return stream
        later = frames(replace(self.spec, again=1))
        scans = round(CARRIED_S * self.spec.settings.rate_hz)
        start = list(targets(stream, later, scans, self.carried + 1))[-1]
        return chain(stream, kidnapped(stream, later, start, scans))


PANELS = (
    Panel(title="boards close in", spec=StreamSpec(kind="pass10", seed=3, seconds=75.0)),
    Panel(title="carried at 60 s", spec=StreamSpec(kind="chairs8", seed=4, seconds=60.0),
          carried=0),
    Panel(title="a room changed out of sight",
          spec=StreamSpec(kind="moved30_calm", seed=2, seconds=75.0)),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Course:
    """``seconds`` (n,), ``shares`` (n, 4) as in ``LOOKS``, ``error_m`` (n,), ``written`` (n,)."""

    seconds: Float
    shares: Float
    error_m: Float
    written: Float


def followed(stream: Iterable[Frame]) -> Course:
    """What the SLAM believes scan by scan."""
    slam, rows = ShuntingSlam(), []
    start: Float | None = None
    first_ns = 0
    for frame in stream:
        assert frame.truth is not None
        if start is None:
            start, first_ns = frame.truth, frame.stamp_ns
        seconds = (frame.stamp_ns - first_ns) / NS_PER_S
        estimate = slam.update(frame.without_truth())
        error, _ = off(estimate.T_map_robot, se2.between(start, frame.truth))
        written = estimate.diagnostics["state"] == "tracking"
        rows.append([seconds, *shares(slam), error, written])
    table = np.array(rows, dtype=np.float64)
    return Course(table[:, 0], table[:, 1:5], table[:, 5], table[:, 6])


def shares(slam: ShuntingSlam) -> list[float]:
    """Probabilities as in ``LOOKS`` after the latest scan."""
    belief = slam._belief
    episode = belief._episode
    if episode is None:
        return [1.0 - belief.p_lost, 0.0, 0.0, belief.p_lost]
    nearby = elsewhere = 0.0
    weighed = belief._weighed
    for place, p in zip(episode.places.followed, weighed.places, strict=True):
        if place.prior > episode.carried_there:
            nearby += p
        else:
            elsewhere += p
    return [weighed.followed, nearby, elsewhere, weighed.unknown]


def window(course: Course) -> tuple[float, float]:
    """Seconds about the longest time that the map was not written and the pose came right again.

    About the scan at which motion was believed least, where it was always written.
    """
    frozen = np.concatenate([[False], course.written < 0.5, [False]])
    edges = np.flatnonzero(frozen[1:] != frozen[:-1])
    begins, ends = edges[::2], np.minimum(edges[1::2], len(course.seconds) - 1)
    right = course.error_m[ends] < RIGHT_M
    if right.any():
        lasted = np.where(right, ends - begins, -1)
        begin, end = (float(course.seconds[e[np.argmax(lasted)]]) for e in (begins, ends))
    else:
        begin = end = float(course.seconds[np.argmin(course.shares[:, 0])])
    return begin - BESIDE_S, end + BESIDE_S


@styled()
def picture(panels: Sequence[Panel], path: Path) -> None:
    """Run all, and draw them side by side."""
    figure = Figure(figsize=(11.0, 5.4))
    axes = figure.subplots(2, len(panels), sharex="col", sharey="row", squeeze=False,
                           height_ratios=(2.2, 1.0))  # fmt: skip
    for column, panel in enumerate(panels):
        _draw(axes[0, column], axes[1, column], panel, followed(panel.frames()))
    axes[0, 0].set_ylabel("probability [1]")
    axes[1, 0].set_ylabel("error of the pose [m]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    save(figure, path)


def _draw(above: Axes, below: Axes, panel: Panel, course: Course) -> None:
    begin_s, end_s = window(course)
    shown = (course.seconds >= begin_s) & (course.seconds <= end_s)
    seconds = course.seconds[shown]
    for k, (name, tint, dashes) in enumerate(LOOKS):
        p = np.maximum(course.shares[shown, k], 0.5 * LEAST)
        above.step(seconds, p, where="post", color=tint, ls=dashes, lw=1.5, label=name)
    frozen = course.written[shown] < 0.5
    for ax in (above, below):
        ax.fill_between(
            seconds, 0.0, 1.0, where=frozen, step="post", color=FROZEN, alpha=0.15, lw=0,
            transform=ax.get_xaxis_transform(), label="map not written",
        )  # fmt: skip
        ax.margins(x=0.0)
    above.set_yscale("log")
    above.set_ylim(LEAST, 1.5)
    above.set_title(panel.title)
    below.step(
        seconds, np.maximum(course.error_m[shown], 1e-3), where="post", color="#20242c", lw=1.2
    )
    below.set_yscale("log")
    below.set_ylim(1e-3, 20.0)
    below.set_xlabel("time [s]")


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=PICTURE)
    wanted = parser.parse_args(arguments)
    picture(PANELS, wanted.out)
    print(f"wrote {wanted.out}")
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))
