# SPDX-License-Identifier: Apache-2.0
"""Is what is believed at p right in p of all cases? On streams of the plane that nobody tuned on.

A scan: the SLAM says that its pose is right with 1 - ``p_lost``; it is where the error is below
``ALERT_M``. A hypothesis, while there are several: where motion led (with the places nearby), each
place elsewhere, and carried to nobody knows where, which is right where none of the others is.
"""

import copy
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.figures import COLORS, save, styled
from scripts.integrity.counting import ALERT_M
from scripts.integrity.kidnap import kidnapped, scans_after, targets
from scripts.integrity.labelled import WRONG_RAD, off
from scripts.integrity.plane import StreamSpec, frames
from scripts.integrity.ways import DECIDABLE, EACH, MAPPED_S, WAYS
from scripts.marks import table
from slam import se2
from slam.evaluation.statistics import central_interval
from slam.frames import Float, Frame
from slam.shunting import ShuntingSlam

TESTED = ("boards", "herd", "crowd", "outdated", "kidnap", "kidnap-crowd", "kidnap-moved")
EDGES = (0.0, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 1.0)
RESAMPLED = 1000
FEW = 100  # scans or hypotheses: a bin with fewer says little
TITLES = {"scans": "the pose", "hypotheses": "hypotheses"}
MOTION, NEARBY, ELSEWHERE, UNKNOWN = range(4)
Said = list[tuple[float, bool]]
"""What is believed at which probability, and whether it is right."""


class Hypothesis(NamedTuple):
    """``what`` of ``MOTION`` to ``UNKNOWN``, at ``p``; its pose, where it has one."""

    what: int
    p: float
    T_map_robot: Float | None = None


def believed(slam: ShuntingSlam) -> list[Hypothesis]:
    """All hypotheses at the latest scan; nothing while there is but one."""
    belief = slam._belief
    episode = belief._episode
    if episode is None:
        return []
    found = []
    for place, p in zip(episode.places.followed, belief._weighed.places, strict=True):
        what = NEARBY if place.prior > episode.carried_there else ELSEWHERE
        found.append(Hypothesis(what, p, place.match.T_map_robot))
    motion = Hypothesis(MOTION, belief._weighed.followed, episode.match.T_map_robot)
    return [motion, *found, Hypothesis(UNKNOWN, belief._weighed.unknown)]


@dataclass(frozen=True, kw_only=True)
class Tested:
    """One stream: its way to be lost, kind and seed, what was said of scans and hypotheses."""

    way: str
    kind: str
    seed: int
    scans: Said = field(default_factory=list)
    hypotheses: Said = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Bin:
    """``n`` cases believed at ``low`` to ``high``: ``mean`` p, share ``right``, its interval."""

    low: float
    high: float
    n: int
    mean: float
    right: float
    ends: tuple[float, float]

    @property
    def name(self) -> str:
        """As a column or a tick says it."""
        return f"{self.low:g} to {self.high:g}"


def specs(
    ways: Sequence[str], seeds: Sequence[int], seconds: float
) -> list[tuple[str, StreamSpec]]:
    """Each kind of these ways with each seed."""
    out = []
    for name in ways:
        way = WAYS[name]
        for n, (kind, seed) in enumerate((k, s) for s in seeds for k in way.kinds):
            changes = (("layout", DECIDABLE[n % len(DECIDABLE)]),) if way.event else ()
            length = MAPPED_S if way.event else seconds
            out.append((name, StreamSpec(kind=kind, seed=seed, seconds=length, changes=changes)))
    return out


def tested(one: tuple[str, StreamSpec]) -> Tested:
    """Run the SLAM over a stream, and over what follows each kidnap."""
    name, spec = one
    stream, slam = frames(spec), ShuntingSlam()
    out = Tested(way=name, kind=spec.kind, seed=spec.seed)
    start = stream[0].truth
    assert start is not None
    error = _follow(slam, stream, start, out)
    if WAYS[name].event and error < ALERT_M:
        later = frames(replace(spec, again=1))
        scans = scans_after(stream)
        for k in targets(stream, later, scans, EACH):
            _follow(copy.deepcopy(slam), kidnapped(stream, later, k, scans), start, out)
    return out


def _follow(slam: ShuntingSlam, stream: Iterable[Frame], start: Float, out: Tested) -> float:
    """The last error, m."""
    error = math.inf
    for frame in stream:
        estimate = slam.update(frame.without_truth())
        assert frame.truth is not None
        truth = se2.between(start, frame.truth)
        error, _ = off(estimate.T_map_robot, truth)
        out.scans.append((1.0 - float(estimate.diagnostics["p_lost"]), error < ALERT_M))
        out.hypotheses.extend(weighed(slam, truth))
    return error


def weighed(slam: ShuntingSlam, truth: Float) -> Said:
    """What the belief makes of each hypothesis at the latest scan; nothing while it has but one."""
    group, where, said, unknown = 0.0, None, [], 0.0
    for what, p, pose in believed(slam):
        if what == ELSEWHERE:
            said.append((p, _is_there(pose, truth)))
        elif what == UNKNOWN:
            unknown = p
        else:
            group, where = group + p, pose if what == MOTION else where
    if where is None:
        return []
    said.append((group, _is_there(where, truth)))
    return [*said, (unknown, not any(right for _, right in said))]


def _is_there(pose: Float | None, truth: Float) -> bool:
    assert pose is not None
    m, rad = off(pose, truth)
    return m < ALERT_M and rad < WRONG_RAD


def curve(streams: Sequence[Said], edges: Sequence[float] = EDGES) -> list[Bin]:
    """Share that is right in each bin that has any; intervals by resampling the streams."""
    count = len(edges) - 1
    sums = np.zeros((len(streams), 3, count))  # n, p, right
    for k, said in enumerate(streams):
        p, right = np.array(said, dtype=np.float64).reshape(-1, 2).T
        at = np.clip(np.searchsorted(edges, p, side="right") - 1, 0, count - 1)
        for row, weights in enumerate((np.ones_like(p), p, right)):
            sums[k, row] = np.bincount(at, weights, count)
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(len(streams), [1.0 / len(streams)] * len(streams), RESAMPLED)
    again = np.tensordot(drawn.astype(np.float64), sums, axes=1)
    total = sums.sum(axis=0)
    bins = []
    for k in np.flatnonzero(total[0]).tolist():
        some = again[again[:, 0, k] > 0.0]
        low, high = central_interval((some[:, 2, k] / some[:, 0, k]).tolist())
        n, p, right = total[:, k].tolist()
        bins.append(
            Bin(low=edges[k], high=edges[k + 1], n=round(n), mean=p / n, right=right / n,
                ends=(low, high))
        )  # fmt: skip
    return bins


def off_by(bins: Sequence[Bin], few: int = FEW) -> tuple[float, float]:
    """Mean of |share right - mean p| over all cases, and its most over bins with ``few`` or more.

    The first is what the field calls the expected calibration error.
    """
    gaps = np.array([abs(one.right - one.mean) for one in bins])
    counts = np.array([float(one.n) for one in bins])
    many = gaps[counts >= few]
    return float((gaps * counts).sum() / counts.sum()), float(many.max()) if len(many) else math.nan


def markdown(curves: dict[str, list[Bin]]) -> str:
    """A table of each curve."""
    parts = []
    for name, bins in curves.items():
        rows = [
            [one.name, f"{one.n}", f"{one.mean:.4f}", f"{one.right:.4f}",
             f"{one.ends[0]:.4f} to {one.ends[1]:.4f}"]
            for one in bins
        ]  # fmt: skip
        mean, most = off_by(bins)
        heads = (f"{TITLES[name]} believed at p", "n", "mean p", "share right", "95 %")
        told = (
            f"Off by {mean:.4f} in the mean over all {name}, and by {most:.3f} at most in a row "
            f"with {FEW} or more."
        )
        parts += [table(heads, rows), told]
    return "\n\n".join(parts)


@styled()
def picture(curves: dict[str, list[Bin]], path: Path) -> None:
    """Share right against what is believed, a panel each."""
    figure = Figure(figsize=(9.0, 3.6))
    axes = figure.subplots(1, len(curves), sharey=True, squeeze=False)[0]
    for ax, (name, bins) in zip(axes, curves.items(), strict=True):
        _panel(ax, bins)
        ax.set_title(f"{TITLES[name]}: n {name} a bin above", fontsize=9, pad=26)
    axes[0].set_ylabel("share that is right [1]")
    axes[0].legend(fontsize=8, loc="upper left", frameon=False)
    save(figure, path)


def _panel(ax: Axes, bins: Sequence[Bin]) -> None:
    at = np.arange(len(bins))
    ends = np.array([one.ends for one in bins])
    ax.vlines(at, ends[:, 0], ends[:, 1], color=COLORS["shunting"], lw=4, alpha=0.35, label="95 %")
    ax.plot(at, [one.right for one in bins], "o", color=COLORS["shunting"], label="share right")
    means = [one.mean for one in bins]
    ax.hlines(means, at - 0.35, at + 0.35, color=COLORS["truth"], lw=2, label="mean p believed")
    for k, one in enumerate(bins):
        ax.annotate(f"{one.n}", (k, 1.04), xycoords=("data", "axes fraction"), ha="center",
                    fontsize=7, rotation=30)  # fmt: skip
    ax.set_xticks(at, [one.name for one in bins], rotation=35, ha="right", fontsize=8)
    ax.set_xlabel("believed at probability p [1]")
    ax.set_ylim(-0.03, 1.03)
