# SPDX-License-Identifier: Apache-2.0
"""What an experiment leaves: figures as PNG and SVG, a Markdown table, the recipe."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.transforms import Bbox
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from scripts.jobs import Job, run_jobs
from scripts.machine import machine
from scripts.marks import table
from scripts.output import write_recipe
from scripts.paper.runs import Plan, Run, checksums, load_run, spread, spread_text
from slam import create
from slam.files import refuse_links, replacing, write_text
from slam.frames import Float

COLORS = {
    "truth": "#168c5a", "odometry": "#de6e18", "occupancy": "#7a3fb0", "EKF": "#1f61be",
    "shunting": "#ce2c3c", "shunting, features": "#e377c2", "shunting, paper preset": "#12a3b4",
    "shunting, paper preset, beams": "#d4a017",
    "known associations": "#5b6472", "graph": "#111111", "GPS": "#168c5a",
}  # fmt: skip
# {SLAM: {quantity: (mean, var(e), var(p))}}
Table = dict[str, dict[str, tuple[float, float, float]]]
TABLE_1: Table = {
    "EKF": {
        "x": (0.6209, 0.0806, 0.6263), "y": (0.8744, 0.0447, 0.8755),
        "θ": (0.2119, 0.0048, 0.2173),
        "landmark x": (0.8316, 0.1098, 0.8982), "landmark y": (0.9793, 0.0697, 0.6169),
    },
    "shunting": {
        "x": (0.3408, 0.0424, 0.3435), "y": (0.5715, 0.0419, 0.5735),
        "θ": (0.1053, 0.0024, 0.0985),
        "landmark x": (0.7112, 0.0623, 0.6237), "landmark y": (0.8123, 0.0699, 0.5091),
    },
}  # fmt: skip
TABLE_2: Table = {
    "EKF": {
        "x": (-0.0598, 0.0649, 0.1114), "y": (-0.1138, 0.0412, 0.1208),
        "θ": (-0.0667, 0.0224, 0.0702),
        "landmark x": (-0.0702, 0.0899, 0.3012), "landmark y": (-0.1371, 0.0622, 0.2260),
    },
    "shunting": {
        "x": (0.0554, 0.0192, 0.0781), "y": (-0.0891, 0.0261, 0.0927),
        "θ": (-0.0547, 0.0166, 0.0574),
        "landmark x": (0.0692, 0.0437, 0.1191), "landmark y": (-0.1029, 0.0494, 0.1054),
    },
}  # fmt: skip
TABLE_3: Table = {
    "EKF": {
        "x": (-0.2339, 2.1564, 2.2190), "y": (0.4006, 1.4014, 1.4324),
        "θ": (0.9674, 1.1644, 1.4973),
    },
    "shunting": {
        "x": (0.0762, 0.0183, 0.0781), "y": (-0.0783, 0.0281, 0.0831),
        "θ": (-0.0565, 0.0166, 0.0592),
    },
}  # fmt: skip
Numbers = Mapping[str, Mapping[str, Any]]  # of one run: SLAM -> its numbers
_STATISTICS = (("mean", "mean(e)", 0), ("var_e", "var(e)", 1), ("var_p", "var(p)", 2))


@dataclass(eq=False)
class Report:
    """One experiment's folder; raises as ``refuse_links``."""

    name: str
    plan: Plan
    lines: list[str] = field(default_factory=list)
    quoted: list[str] = field(default_factory=list)  # what the page of all experiments repeats
    recipe: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        refuse_links(self.folder)

    @property
    def folder(self) -> Any:
        """Where it all goes."""
        return self.plan.out / self.name

    def run(self, jobs: Iterable[Job]) -> dict[str, Run]:
        """Make the runs that are missing; all of them."""
        listed, runs = list(jobs), self.folder / "runs"
        files = run_jobs(listed, runs, processes=self.plan.processes, title=self.name)
        self.recipe["runs"] = {job.name: dict(job.arguments) for job in listed}
        return {name: load_run(file) for name, file in files.items()}

    def systems(self, systems: Mapping[str, tuple[str, Mapping[str, Any]]]) -> None:
        """Into the recipe: kind, options and whole configuration of each SLAM."""
        told = self.recipe.setdefault("systems", {})
        for name, (kind, options) in systems.items():
            config = getattr(create(kind, **options), "config", None)
            whole = {} if config is None else {"config": asdict(config)}
            told[name] = {"slam": kind, "options": dict(options), **whole}

    def heading(self, text: str) -> None:
        """A section of the page."""
        self.lines += ["", f"## {text}", ""]

    def say(self, text: str, *, quote: bool = False) -> None:
        """A paragraph; with ``quote`` in the summary too."""
        self._add([text, ""], quote)

    def table(
        self, head: Sequence[str], rows: Iterable[Sequence[str]], *, quote: bool = False
    ) -> None:
        """A table; the first column is words, the others are numbers."""
        self._add([*table(head, rows).splitlines(), ""], quote)

    def _add(self, lines: list[str], quote: bool) -> None:
        self.lines += lines
        if quote:
            self.quoted += lines

    def figure(self, name: str, figure: Figure, caption: str) -> None:
        """``name``.png and ``name``.svg, and the picture in the page and in the summary."""
        for suffix in ("png", "svg"):
            metadata = {"Software": None} if suffix == "png" else {"Date": None}
            with (
                replacing(self.folder / f"{name}.{suffix}") as temporary,
                mpl.rc_context({"svg.hashsalt": "mobilia"}),
            ):
                figure.savefig(temporary, dpi=130, metadata=metadata)
        self._add([f"![{caption}]({name}.png)", "", f"*{caption}*", ""], quote=True)

    def finish(self, title: str) -> None:
        """Write the page and the recipe."""
        said = ["Quick: too short and too few to conclude from.", ""] if self.plan.quick else []
        page = [f"# {title}", "", *said, *self.lines]
        write_text(self.folder / "README.md", "\n".join(page).rstrip() + "\n")
        write_text(self.folder / "summary.md", "\n".join(self.quoted).rstrip() + "\n")
        plan = self.plan
        settings = asdict(plan) | {"out": str(plan.out), "seeds": plan.seed_list()}
        if plan.data is not None:
            settings["data"] = {"folder": str(plan.data), "sha256": checksums(plan.data)}
        told = {"plan": settings, "machine": machine(), **self.recipe}
        write_recipe(self.folder, f"reproduce {self.name}", told)


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> Any:
    """A figure and its axes (always an array, row by row); for experiments that are ``styled``."""
    figure = Figure(figsize=(width, height))
    return figure, np.atleast_1d(figure.subplots(rows, columns, **options)).ravel()


def draw_ellipses(ax: Axes, ellipses: Float, *, label: str = "", dot: float = 2.5) -> None:
    """(n, 5) centre, half axes, direction; a dot in each so that tiny ones are seen."""
    if len(ellipses):
        ax.add_collection(
            EllipseCollection(
                2.0 * ellipses[:, 2], 2.0 * ellipses[:, 3], np.degrees(ellipses[:, 4]),
                units="xy", offsets=ellipses[:, :2], offset_transform=ax.transData,
                facecolors="none", edgecolors="black", linewidths=0.9,
            )
        )  # fmt: skip
    ax.plot(ellipses[:, 0], ellipses[:, 1], ".", color="black", ms=dot, label=label)


def draw_activities(
    ax: Axes, values: NDArray[Any], origin: Float, cell: float, cmap: str, *, swell: bool = False
) -> Any:
    """A map's activities (rows from the lowest y) as an image; ``swell`` makes blobs of few
    neurons, which would be less than a pixel, a 150th of the picture."""
    height, width = values.shape
    x, y = float(origin[0]), float(origin[1])
    size = 1 + 2 * (max(height, width) // 300) if swell else 1
    swollen = maximum_filter(values.astype(np.float32), size=size)
    shown = np.where(swollen > 0.02, swollen, np.nan)
    return ax.imshow(
        shown, origin="lower", extent=(x, x + width * cell, y, y + height * cell), cmap=cmap,
        vmin=0.0, vmax=1.0, interpolation="nearest",
    )  # fmt: skip


def error_axes(seconds: Float, errors: Mapping[str, Float], title: str) -> Figure:
    """The paper's Figs. 7, 9, 12: errors in x, y and heading over time, one line for each SLAM.

    Linear, unless one SLAM's errors dwarf another's: then linear near zero, logarithmic beyond.
    """
    figure: Figure
    figure, axes = new_figure(9.0, 7.0, rows=3, sharex=True)
    for ax, k, unit in zip(axes, range(3), ("x in m", "y in m", "heading in rad"), strict=True):
        for name, e in errors.items():
            ax.plot(seconds, e[:, k], color=COLORS[name], lw=1.2, label=name)
        ax.axhline(0.0, color="black", lw=0.5)
        ax.set(ylabel=f"error of {unit}")
        sizes = [float(np.nanmax(np.abs(e[:, k]))) for e in errors.values()]
        sizes = [size for size in sizes if size > 0.0]
        if sizes and max(sizes) > 15.0 * min(sizes):
            # a power of ten: else the first tick lies within the linear part, on that of zero
            ax.set_yscale("symlog", linthresh=10.0 ** round(math.log10(min(sizes))))
    axes[0].set(title=title)
    axes[0].legend(frameon=False, ncols=4, fontsize=8)
    axes[2].set(xlabel="time in s")
    return figure


FAINTEST = 0.02  # activity that is drawn


def show(ax: Axes, window: Bbox) -> None:
    """Of these axes, this part of the plane only, m."""
    ax.set(xlim=window.intervalx, ylim=window.intervaly, aspect="equal")


def mark(ax: Axes, window: Bbox) -> None:
    """As a frame, in axes that show more."""
    size = window.width, window.height
    ax.add_patch(Rectangle(window.min, *size, fill=False, ec="#ce2c3c", lw=1.2, zorder=9))


def window_over(things: Iterable[Float]) -> Bbox:
    """All (n, 2) points, and a little beside them, m."""
    points = np.concatenate([np.asarray(thing)[:, :2] for thing in things])
    low, high = points.min(axis=0), points.max(axis=0)
    edge = 0.03 * float((high - low).max())
    return Bbox([low - edge, high + edge])


def window_about(middle: Float, half: float) -> Bbox:
    """A square, m."""
    return Bbox([middle - half, middle + half])


def active(values: NDArray[Any], origin: Float, cell: float) -> Float:
    """(n, 2) centres of the neurons that are drawn."""
    rows, columns = np.nonzero(values > FAINTEST)
    return (np.column_stack([columns, rows]) + 0.5) * cell + np.asarray(origin)[:2]


def map_panels(windows: Sequence[Bbox], columns: int, width: float) -> tuple[Figure, Any]:
    """Axes, row by row, in a figure of the height that leaves no white about these windows; all of
    a row have one window."""
    wide = (width - 0.9) / columns - 0.6
    height = 0.5
    for window in windows:
        height += wide * window.height / window.width + 0.7
    figure, axes = new_figure(width, height, rows=len(windows), columns=columns)
    for k, ax in enumerate(axes):
        show(ax, windows[k // columns])
        ax.set(ylabel="y in m" if k % columns == 0 else "", xlabel="x in m")
    return figure, axes


def drawn(run: Run, name: str = "") -> tuple[Any, Float, float]:
    """Activities, origin and cell of a map in a run."""
    a, of = run.arrays, name and f" {name}"
    return a[f"activities{of}"], a[f"origin{of}"], float(a[f"cell{of}"])


def both_maps(
    runs: Mapping[str, Run],
    whole: Bbox,
    part: Bbox,
    also: Callable[[Axes, str, bool], None],
    *,
    width: float,
    dots: tuple[float, float] = (2.5, 2.5),
) -> Figure:
    """EKF with 3 sigma ellipses beside the shunting map's activities, and below a part of both.

    also  draws what else is in the axes of a SLAM, and their title; True: the part
    dots  in the ellipses of the whole and of the part
    """
    figure, axes = map_panels([whole, part], columns=2, width=width)
    for k, ax in enumerate(axes):
        name, below = ("EKF", "shunting")[k % 2], k >= 2
        if name == "EKF":
            ellipses = runs[name].arrays["ellipses"]
            draw_ellipses(ax, ellipses, label="landmark, 3 σ", dot=dots[below])
        else:
            image = draw_activities(ax, *drawn(runs[name]), "Greys", swell=not below)
        also(ax, name, below)
        show(ax, part if below else whole)
    figure.colorbar(image, ax=list(axes), shrink=0.5, aspect=40, label="activity")
    legend_below(figure, axes)
    return figure


def legend_below(figure: Figure, axes: Iterable[Axes]) -> None:
    """One for all axes, each name once."""
    named: dict[str, Any] = {}
    for ax in axes:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    figure.legend(
        named.values(), named.keys(), loc="outside lower center", ncols=len(named), frameon=False
    )


def paper_table(
    report: Report, title: str, printed: Table, runs: Sequence[Numbers], columns: Sequence[str]
) -> None:
    """One row for each quantity and statistic: paper, our single run, median over the seeds.

    Of means the median over the seeds is that of their size, as signs differ from seed to seed.
    """
    many = len(runs) > 1
    seeds = "medians with quartiles over the seeds, of means the median of their size"
    ours = f"our single run, and {seeds}" if many else "our one run"
    report.say(
        f"**{title}**: the paper's numbers, {ours}. var(p) is printed, not compared.", quote=True
    )
    head = ["", "paper EKF", "paper “Our”"]
    head += [f"{name}, single run" for name in columns]
    if many:
        head += [f"{name}, {len(runs)} seeds" for name in columns]
    rows = []
    for quantity in printed["EKF"]:
        unit = "rad" if quantity == "θ" else "m"
        for key, label, place in _STATISTICS:
            squared = "" if place == 0 else "²"
            row = [f"{quantity}: {label}, {unit}{squared}"]
            row += [f"{printed[who][quantity][place]:.4f}" for who in ("EKF", "shunting")]
            number = f"{key} {quantity}"
            row += [_cell(runs[0][name].get(number)) for name in columns]
            if many:
                row += [spread_text(sizes(runs, name, number), ".2g") for name in columns]
            rows.append(row)
    report.table(head, rows, quote=True)


def sizes(runs: Sequence[Numbers], name: str, key: str) -> list[float]:
    """|that number| of a SLAM in each run; NaN where it has none."""
    return [abs(run[name].get(key, math.nan)) for run in runs]


def _cell(value: float | None) -> str:
    return "–" if value is None or value != value else f"{value:.3g}"


def below_printed(
    printed: Table, runs: Sequence[Numbers], name: str, *, limits: Mapping[str, Any] | None = None
) -> list[str]:
    """For each quantity, whether |mean| and var(e) (medians) are below the paper's "Our" or
    ``limits`` (quantity -> (mean, var)); in words, short-falls in bold."""
    out = []
    for quantity, (mean, var_e, _) in printed["shunting"].items():
        want = (limits or {}).get(quantity, (abs(mean), var_e))
        for key, most in (("mean", want[0]), ("var_e", want[1])):
            got, _, _ = spread(sizes(runs, name, f"{key} {quantity}"))
            sign = "|mean(e)|" if key == "mean" else "var(e)"
            told = f"{quantity} {sign} {got:.2g} against {most:.2g}"
            out.append(told if got <= most else f"**{told}: short**")
    return out
