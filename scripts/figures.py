# SPDX-License-Identifier: Apache-2.0
"""Still figures: trajectories, errors and map of a run; what all curves against a level share."""

import html
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray
from scipy.ndimage import center_of_mass, maximum_filter
from scipy.ndimage import label as components

from slam import se2
from slam.estimate import Changes
from slam.files import replacing
from slam.frames import NS_PER_S, Float
from slam.system import Raster
from slam.trajectory import Trajectory

COLORS = {"shunting": "#ce2c3c", "odometry": "#de6e18", "truth": "#168c5a"}
CHANGED = 0.45  # fainter differences: looks too few to tell
NEW = 0.7  # what appeared must differ by more: a wall seen for the first time is new, too
_TICKS = (  # up to which ratio of the ends which multiples of a power of ten are labelled
    (3.0, (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)),
    (1000.0, (1.0, 2.0, 5.0)),
    (math.inf, (1.0,)),
)
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_GLYPHS = ("●", "■", "▲", "◆", "▼", "✚", "✖")
Point = tuple[float, float, float, float]
"""x, value, and the ends of its interval; NaN for what is not there."""
LINEAR_DEG = 1.0  # degrees about 0 where the axis of the heading error is linear
_LOOK: dict[str, Any] = {
    "font.size": 9, "axes.grid": True, "grid.alpha": 0.35, "axes.spines.top": False,
    "axes.spines.right": False, "figure.constrained_layout.use": True,
}  # fmt: skip
INK, MUTED, _RULE = "#20242c", "#6b7280", "#d9dce1"
SVG: dict[str, Any] = {  # what is different in the figures that lie in a page
    "font.family": "sans-serif", "axes.labelsize": 9.0, "axes.titlesize": 9.5,
    "axes.titleweight": "bold", "axes.titlelocation": "left", "axes.edgecolor": MUTED,
    "axes.labelcolor": INK, "text.color": INK, "xtick.color": MUTED, "ytick.color": MUTED,
    "axes.linewidth": 0.7, "axes.grid.axis": "y", "grid.color": _RULE, "grid.linewidth": 0.6,
    "grid.alpha": 1.0, "axes.axisbelow": True, "legend.frameon": False,
    "figure.constrained_layout.use": False, "svg.fonttype": "none", "svg.hashsalt": "mobilia",
}  # fmt: skip
_SPARE = ("#1f61be", "#7a3fb0", "#0b8c96", "#8c6d1f", "#59616e", "#b8418f", "#5d8a1e", "#3b2f7d",
          "#a0583c", "#2f9fd0")  # fmt: skip


def color_of(name: str, order: Sequence[str]) -> str:
    """One colour per system, the same in every figure of a run."""
    if name in COLORS:
        return COLORS[name]
    others = [other for other in order if other not in COLORS]
    return _SPARE[others.index(name) % len(_SPARE)]


@contextmanager
def styled(changes: Mapping[str, Any] | None = None) -> Iterator[None]:
    """The look of our figures, for those that are made, drawn and saved in here; a decorator too.

    ``changes``: what is different in these, as in ``matplotlib.rcParams``. Nothing is left behind.
    """
    with mpl.rc_context({**_LOOK, **(changes or {})}):
        yield


def marker(slam: str, slams: Sequence[str]) -> str:
    """One marker per SLAM, for those who print in black or see colours otherwise."""
    return _MARKERS[list(slams).index(slam) % len(_MARKERS)]


def glyph(slam: str, slams: Sequence[str]) -> str:
    """That marker as a letter."""
    return _GLYPHS[list(slams).index(slam) % len(_GLYPHS)]


def apart(slam: str, slams: Sequence[str], levels: Sequence[float]) -> float:
    """How far beside a level a SLAM is drawn, so that intervals do not hide each other."""
    span = max(levels) - min(levels) or 1.0
    gap = 0.02 * span * min(1.0, 4.0 / max(len(levels) - 1, 1), 6.0 / len(slams))
    return gap * (list(slams).index(slam) - 0.5 * (len(slams) - 1))


def line(ax: Axes, points: Sequence[Point], color: str, mark: str, label: str = "") -> None:
    """Values with their intervals; a cross at the top stands for an infinite one."""
    shown = [(x, value) for x, value, _, _ in points if math.isfinite(value)]
    ax.plot([x for x, _ in shown], [y for _, y in shown], color=color, marker=mark, ms=5.0, lw=1.6,
            mec="white", mew=0.6, zorder=3, label=label)  # fmt: skip
    for x, value, low, high in points:
        if math.isfinite(low) and high == math.inf:  # past the axes, which do not grow for it
            bar = Line2D([x, x], [low, 1e12], color=color, lw=3.2, alpha=0.3, zorder=2)
            bar.set_clip_path(ax.patch)
            ax.add_artist(bar)
        elif math.isfinite(low) and math.isfinite(high):
            ax.plot([x, x], [low, high], color=color, lw=3.2, alpha=0.3, solid_capstyle="round",
                    zorder=2)  # fmt: skip
        if value == math.inf:
            ax.plot([x], [0.99], marker="x", ms=7, mew=1.8, color=color, clip_on=False,
                    transform=ax.get_xaxis_transform())  # fmt: skip


def level_axis(ax: Axes, levels: Sequence[float], axis: str = "dynamism") -> None:
    """What the levels are of, a tick for each level."""
    ax.set_xlabel(axis)
    ax.set_xticks(levels)
    ax.set_xticklabels([f"{level:g}" for level in levels])


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG of 150 dpi, whole or not at all."""
    figure.set_dpi(150)
    with replacing(path) as temporary:
        # savefig would draw a figure with a layout twice
        FigureCanvasAgg(figure).print_png(temporary, metadata={"Software": None})


def svg(figure: Figure, title: str) -> str:
    """The figure as an ``<svg>`` element: scales with the page, its text is text.

    Made, drawn and written under ``styled(SVG)``.
    """
    figure.patch.set_alpha(0.0)
    written = io.StringIO()
    figure.savefig(written, format="svg", metadata={"Date": None, "Creator": None})
    text = written.getvalue()
    text = text[text.index("<svg") :].rstrip()
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' (?:width|height)="[\d.]+pt"', "", text, count=2)
    return text.replace("<svg ", f'<svg role="img" aria-label="{html.escape(title)}" ', 1)


def remark(ax: Axes, y: float, words: str, tint: str) -> None:
    """Small words at the right end of a horizontal line, outside."""
    ax.annotate(words, (1.0, y), xycoords=("axes fraction", "data"), xytext=(3, 0),
                textcoords="offset points", va="center", color=tint, fontsize=8)  # fmt: skip


def _axes(
    width: float, height: float, margins: tuple[float, float, float, float], rows: int = 1
) -> tuple[Figure, NDArray[np.object_]]:
    """``margins``: inches left, right, below and above, which saves the third of the time of a
    picture that it takes to measure all words."""
    left, right, below, above = margins
    with mpl.rc_context({"figure.constrained_layout.use": False}):
        figure = Figure(figsize=(width, height))
    axes = np.atleast_1d(figure.subplots(rows, 1, sharex=rows > 1))
    figure.subplots_adjust(
        left=left / width, right=1.0 - right / width, bottom=below / height,
        top=1.0 - above / height, hspace=0.1,
    )  # fmt: skip
    return figure, axes


@styled()
def trajectories(
    path: Path,
    tracks: Mapping[str, Trajectory],
    truth: Trajectory | None,
    raster: Raster | None,
    truth_name: str,
) -> None:
    """``tracks`` over the map, all in its frame."""
    beside = 0.6 + 0.085 * max(map(len, [*tracks, truth_name, "start"]))  # of the legend, inches
    figure, axes = _axes(9.0, 6.0, (0.75, beside, 0.5, 0.3))
    ax: Axes = axes[0]
    if raster is not None:
        draw_raster(ax, raster)
    for name, track in tracks.items():
        color = color_of(name, list(tracks))
        ax.plot(track.poses[:, 0], track.poses[:, 1], color=color, lw=1.4, label=name)
        ax.plot(*track.poses[-1, :2], "o", color=color, ms=5)
    if truth is not None:
        ax.plot(truth.poses[:, 0], truth.poses[:, 1], "--", color=COLORS["truth"], lw=1.2,
                label=truth_name)  # fmt: skip
    ax.plot(*next(iter(tracks.values())).poses[0, :2], "k+", ms=9, label="start")
    ax.set(xlabel="x in m", ylabel="y in m", title="Trajectories, online")
    ax.set_aspect("equal", adjustable="datalim")  # the way along a corridor fills no strip
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    save(figure, path)


def _extent(raster: Raster) -> tuple[float, float, float, float]:
    """xmin, xmax, ymin, ymax m (axis-aligned origins only, as all of ours are)."""
    height, width = raster.values.shape
    x, y, _ = raster.T_map_origin.tolist()
    return x, x + width * raster.resolution_m, y, y + height * raster.resolution_m


def draw_raster(ax: Axes, raster: Raster, **look: Any) -> None:
    """A raster as grey values under a plot."""
    look = {"vmax": 1.0, "interpolation": "antialiased", **look}
    ax.imshow(np.nan_to_num(raster.values), origin="lower", extent=_extent(raster), cmap="Greys",
              vmin=0.0, **look)  # fmt: skip


@styled()
def errors(path: Path, tracks: Mapping[str, Trajectory], truth: Trajectory) -> None:
    """Position and heading error over time, unaligned: in the frame of the known first pose."""
    figure, axes = _axes(9.0, 5.0, (0.85, 0.1, 0.5, 0.35), rows=2)
    for name, track in tracks.items():
        stamps, offset, turned = error_series(track, truth)
        color = color_of(name, list(tracks))
        axes[0].plot(stamps, offset, color=color, lw=1.3, label=name)
        axes[1].plot(stamps, np.degrees(turned), color=color, lw=1.3, label=name)
    axes[0].set(ylabel="position error in m", yscale="log", title="Error over time, unaligned")
    log_axis(axes[0])
    axes[1].set(ylabel="heading error in degrees", xlabel="time in s")
    axes[1].set_yscale("symlog", linthresh=LINEAR_DEG)  # its sign matters, and it passes 0
    axes[1].yaxis.set_major_formatter(FuncFormatter(lambda v, _at: f"{v:g}".replace("-", "−")))
    axes[0].legend(frameon=False)
    save(figure, path)


def log_axis(ax: Axes) -> None:
    """Decades in plain numbers, with 2 and 5 between them where there are few."""
    drawn = [one for one in ax.lines if one.get_transform() == ax.transData]  # no crosses, no rules
    values = np.concatenate([np.zeros(0), *(np.asarray(one.get_ydata(), float) for one in drawn)])
    if not (values > 0.0).any():
        return
    ax.set_yscale("log", nonpositive="clip")
    low, high = (_step(end, up) for end, up in zip(ax.get_ylim(), (False, True), strict=True))
    ax.set_ylim(low, high)
    subs = next(subs for most, subs in _TICKS if high / low <= most)
    ax.yaxis.set_major_locator(LogLocator(subs=subs))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _at: f"{value:g}"))
    ax.yaxis.set_minor_formatter(NullFormatter())


def _step(value: float, up: bool) -> float:
    """The next 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    steps = [power * k for k in (1.0, 2.0, 5.0, 10.0)]
    return next(s for s in steps if s >= value) if up else max(s for s in steps if s <= value)


def error_series(track: Trajectory, truth: Trajectory) -> tuple[Float, Float, Float]:
    """Seconds, distance (m) and heading difference (rad) where both have the same stamp."""
    stamps, mine, theirs = np.intersect1d(
        track.stamps_ns, truth.stamps_ns, assume_unique=True, return_indices=True
    )
    delta = track.poses[mine] - truth.poses[theirs]
    offset = np.sqrt(delta[:, 0] ** 2 + delta[:, 1] ** 2)
    seconds = (stamps - truth.stamps_ns[0]) / NS_PER_S
    return seconds, np.maximum(offset, 1e-3), se2.wrap_array(delta[:, 2])


@contextmanager
def _over_map(path: Path, raster: Raster, track: Trajectory, title: str) -> Iterator[Axes]:
    """Axes to draw the map on, of its shape; the trajectory comes over it, then it is saved."""
    height, width = raster.values.shape
    wide = min(11.0, max(5.0, 5.5 * width / height + 2.0))
    high = min(6.5, max(2.5, 1.05 + (wide - 2.0) * height / width))  # a corridor needs little
    figure, axes = _axes(wide, high, (0.75, 0.1, 0.75, 0.3))
    ax: Axes = axes[0]
    ax.grid(visible=False)
    yield ax
    ax.plot(track.poses[:, 0], track.poses[:, 1], "k-", lw=0.9, label="trajectory")
    ax.set(xlabel="x in m", ylabel="y in m", aspect="equal", title=title)
    figure.legend(loc="lower center", ncols=4, frameon=False, markerscale=4.0)
    save(figure, path)


def _coloured(ax: Axes, raster: Raster, values: Float, cmap: Any, label: str, pad: float) -> None:
    """What is no NaN in colours, with their bar."""
    image = ax.imshow(values, origin="lower", extent=_extent(raster), cmap=cmap, vmin=0.0,
                      vmax=1.0, interpolation="nearest")  # fmt: skip
    ax.figure.colorbar(image, ax=ax, shrink=0.6, pad=pad, label=label)


@styled()
def map_picture(path: Path, raster: Raster, track: Trajectory, points_map: Float) -> None:
    """The map in the paper's style (Fig. 13): activities coloured, last scan blue, path black."""
    faint = np.where(raster.values > 0.02, raster.values, np.nan)
    colors = mpl.colormaps["YlOrRd"].with_extremes(bad="#fafaf8")
    with _over_map(path, raster, track, "Map: activity of each cell, 0 to 1") as ax:
        _coloured(ax, raster, faint, colors, "activity", 0.05)
        ax.plot(points_map[:, 0], points_map[:, 1], ".", color="#1f61be", ms=1.5, label="last scan")


@styled()
def changes_picture(path: Path, raster: Raster, changes: Changes, track: Trajectory) -> None:
    """Recent changes over the present map, ringed: appeared green, gone red, the rest grey.

    Where nothing has changed there is no picture.
    """
    layers = []
    for layer, least, cmap, label in (
        (changes.gone, CHANGED, "Reds", "gone: in long-term memory, seen empty"),
        (changes.appeared, NEW, "Greens", "new: seen, hardly in long-term memory"),
    ):
        thick = maximum_filter(np.nan_to_num(layer.values), size=3)  # a chair's leg: two cells
        if (thick > least).any():
            layers.append((np.where(thick > least, thick, np.nan), cmap, label))
    if not layers:
        return
    with _over_map(path, raster, track, "Recent changes of the map") as ax:
        ax.set_facecolor("#fafaf8")
        draw_raster(ax, raster, vmax=2.0, interpolation="nearest")
        for values, cmap, label in layers:
            _coloured(ax, raster, values, cmap, label, 0.02)
            places, count = components(np.isfinite(values), structure=np.ones((3, 3)))
            spots = np.array(center_of_mass(places > 0, places, range(1, count + 1)))
            x, y = ((spots[:, ::-1] + 0.5) * raster.resolution_m + raster.T_map_origin[:2]).T
            ax.plot(x, y, "o", mfc="none", mec=mpl.colormaps[cmap](0.8), ms=16, mew=1.2)
