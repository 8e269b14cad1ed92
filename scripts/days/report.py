# SPDX-License-Identifier: Apache-2.0
"""What changed between the sessions of a building, in words, pictures and scores."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patches import Circle

from scripts.console import plain_table
from scripts.days.lifelong import Building
from scripts.days.sessions import SessionDrive
from scripts.days.truth import LEAST_M, ChangeScore, changed_spots, scored
from scripts.figures import save, styled
from scripts.metrics.table import minus
from scripts.pages.page import Part
from sim.recording.tables import table
from slam.days.changes import Change, between
from slam.days.evidence import Snapshot
from slam.days.habits import MobilityMap
from slam.days.history import DAY_S, dense
from slam.days.session import read_history
from slam.estimate import Raster
from slam.files import write_text

HOURS = (9.0, 19.0)  # of the day that the picture of mobility looks ahead to
_COLUMNS = (
    "from_session", "to_session", "change", "x_m", "y_m", "from_x_m", "from_y_m", "size_m",
    "angle_deg", "confidence",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Changed:
    """What changed in a building: in words, as parts of its page, and what of it is true."""

    said: str = ""
    parts: Sequence[Part] = ()
    score: dict[str, Any] | None = None


def changes_of(folder: Path, building: Building, drives: Mapping[int, SessionDrive]) -> Changed:
    """Pictures and changes.csv into ``folder``.

    Each session is compared with the one before that fitted; scored where it was simulated.
    """
    history = read_history(building.map) if building.map.exists() else None
    if history is None or len(building.snapshots) < 2:
        return Changed()
    numbers = sorted(building.snapshots)
    found, scores = {}, []
    for first, second in pairwise(numbers):
        pair = building.snapshots[first], building.snapshots[second]
        found[first, second] = between(*pair, history.cell_m)
        score = _score(found[first, second], building, drives, (first, second), history.cell_m)
        scores += [] if score is None else [score]
    write_text(folder / "changes.csv", table(_COLUMNS, _rows(found)))
    mobility_picture(folder / "mobility.png", MobilityMap(history), HOURS)
    last, every = max(found), [change for changes in found.values() for change in changes]
    shown = [change for change in found[last] if change.confidence >= LEAST]
    if shown:
        pair = building.snapshots[last[0]], building.snapshots[last[1]]
        titles = f"session {last[0]}", f"session {last[1]}"
        changes_picture(folder / "changes.png", pair, titles, history.cell_m, shown)
    return Changed(
        said=operator(shown, every), score=added(scores) if scores else None,
        parts=_parts(last, shown, scores, len(history)),
    )  # fmt: skip


def operator(shown: Sequence[Change], every: Sequence[Change]) -> str:
    """What is otherwise than the time before, for who looks after the building.

    Doors are numbered by where they are among ``every`` change so far.
    """
    hinges: list[tuple[float, float]] = []
    for change in every:
        near = any(math.dist(change.at, hinge) < SAME_M for hinge in hinges)
        hinges += [change.at] if change.kind == "door" and not near else []
    hinges.sort()
    told = []
    for change in shown:
        if change.kind == "door":
            number = 1 + min(range(len(hinges)), key=lambda k: math.dist(change.at, hinges[k]))
            told.append(f"door {number} turned by {abs(change.angle_deg):.0f}°")
    for kind in ("moved", "appeared", "gone"):
        count = sum(change.kind == kind for change in shown)
        told += [f"{count} thing{'' if count == 1 else 's'} {kind}"] if count else []
    return ", ".join(told) or "nothing changed that it could tell"


def added(scores: Sequence[ChangeScore]) -> dict[str, Any]:
    """The counts of all (``ChangeScore``), and the median position error, m."""
    each = {f.name: [getattr(score, f.name) for score in scores] for f in fields(ChangeScore)}
    off = [m for own in each.pop("off_m") for m in own]
    counts = {name: np.sum(values, axis=0).tolist() for name, values in each.items()}
    return counts | {"off_m": float(np.median(off)) if off else None}


def _rows(found: Mapping[tuple[int, int], Sequence[Change]]) -> list[list[object]]:
    rows: list[list[object]] = []
    for (first, second), changes in found.items():
        for c in changes:
            before = ("", "") if c.before is None else (f"{c.before[0]:.3f}", f"{c.before[1]:.3f}")
            at = (f"{c.at[0]:.3f}", f"{c.at[1]:.3f}")
            size = (f"{c.size_m:.2f}", f"{c.angle_deg:.0f}", f"{c.confidence:.3f}")
            rows.append([first, second, c.kind, *at, *before, *size])
    return rows


def _score(
    changes: Sequence[Change],
    building: Building,
    drives: Mapping[int, SessionDrive],
    numbers: tuple[int, int],
    cell_m: float,
) -> ChangeScore | None:
    first, second = (drives[n].recording for n in numbers)
    if first is None or second is None or building.T_map_world is None:
        return None
    snapshots = building.snapshots[numbers[0]], building.snapshots[numbers[1]]
    truth = changed_spots(first, second, snapshots, cell_m, building.T_map_world)
    return scored(changes, truth)


def summed(scores: Sequence[ChangeScore]) -> str:
    """Precision, recall and position error of all, in words."""
    of = added(scores)
    if not of["listed"] or not of["seen"]:
        return "too few changes to score"
    error = f", median position error {100.0 * of['off_m']:.0f} cm" if of["off_m"] else ""
    return (
        f"precision {of['right'] / of['listed']:.2f} ({of['right']} of {of['listed']} places "
        f"listed), recall {of['told'] / of['seen']:.2f} ({of['told']} of {of['seen']} places that "
        f"both sessions saw){error}; truly so: {of['doors'][1]} of {of['doors'][0]} doors, "
        f"{of['moved'][1]} of {of['moved'][0]} moved"
    )


def _parts(
    numbers: tuple[int, int], changes: Sequence[Change], scores: Sequence[ChangeScore], n: int
) -> list[Part]:
    """What changed last, how true such lists are, and how places change in ``n`` sessions."""
    listed = plain_table("the list")
    for heading in ("change", "at, m", "from, m", "size, m", "confidence"):
        listed.add_column(heading)
    for c in changes:
        came = "" if c.before is None else f"{c.before[0]:.2f}, {c.before[1]:.2f}"
        turned = f", by {c.angle_deg:+.0f}°" if c.kind == "door" else ""
        words = (f"{c.kind}{turned}", f"{c.at[0]:.2f}, {c.at[1]:.2f}", came, f"{c.size_m:.2f}")
        listed.add_row(*map(minus, words), f"{c.confidence:.2f}")
    true = (
        "From each session to the next, precision of all that is listed, recall of things "
        f"of at least {LEAST_M:g} m: {summed(scores)}."
    )
    return [
        Part(
            title=f"What changed from session {numbers[0]} to session {numbers[1]}",
            picture="changes.png" if changes else "", note=true if scores else "",
            table=listed if changes else None, legend={**COLOURS_OF_PAGE, UNSEEN: "not seen"},
        ),
        Part(title=f"How its places change, from {n} sessions", picture="mobility.png"),
    ]  # fmt: skip


COLOURS = {"appeared": "#1b7f4d", "gone": "#c0392b", "moved": "#2457a6", "door": "#b8860b"}
UNSEEN = "#b0b4b8"
COLOURS_OF_PAGE = {colour: kind for kind, colour in COLOURS.items()}
LEAST = 0.05  # of the confidence of a change that is told
SAME_M = 0.7  # two hinges so near are one door's


def _image(
    ax: Axes, values: Any, corner: Sequence[float], cell_m: float, colours: str = "Greys"
) -> AxesImage:
    """Values in 0 to 1 by place, of which ``corner`` (x, y) m is the lowest."""
    (x, y, *_), (height, width) = corner, values.shape
    ax.set(facecolor=UNSEEN, xlabel="x, m")
    return ax.imshow(
        values, origin="lower", extent=(x, x + width * cell_m, y, y + height * cell_m),
        cmap=colours, vmin=0.0, vmax=1.0, interpolation="nearest",
    )  # fmt: skip


def changes_picture(
    path: Path,
    snapshots: tuple[Snapshot, Snapshot],
    titles: tuple[str, str],
    cell_m: float,
    changes: Sequence[Change],
) -> None:
    """Both sessions beside each other, every change ringed in its colour."""
    with styled():
        figure = Figure(figsize=(11.0, 4.6))
        axes = figure.subplots(1, 2, sharex=True, sharey=True)
        for ax, snapshot, title in zip(axes, snapshots, titles, strict=True):
            low, images = dense(snapshot.cells, snapshot.standing)
            _image(ax, images[0], (low * cell_m).tolist(), cell_m)
            ax.set_title(title)
        for change in changes:
            colour, radius = COLOURS[change.kind], 0.5 * change.size_m + 0.15
            old = change.kind in ("gone", "door", "moved")
            new = change.kind in ("appeared", "door", "moved")
            first = change.before or change.at
            if old:
                axes[0].add_patch(Circle(first, radius, fill=False, color=colour, lw=1.6))
            if new:
                axes[1].add_patch(Circle(change.at, radius, fill=False, color=colour, lw=1.6))
            if change.before is not None:
                axes[1].annotate(
                    "", change.at, change.before,
                    arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.2},
                )  # fmt: skip
        for kind, colour in COLOURS.items():
            axes[1].plot([], [], "o", mfc="none", color=colour, label=kind)
        axes[1].plot([], [], "s", color=UNSEEN, label="not seen")
        figure.legend(loc="outside lower center", ncols=len(COLOURS) + 1, frameon=False)
        axes[0].set_ylabel("y, m")
        save(figure, path)


def mobility_picture(path: Path, mobility: MobilityMap, hours: Sequence[float]) -> None:
    """How often something stands in each place, how much that changes, and what to expect at
    ``hours`` of the day after the last session."""
    standing, changing = mobility.standing, mobility.mobility
    if standing is None or changing is None:
        return
    last = float(mobility.history.times_s[-1])
    day = (np.floor(last / DAY_S) + 1.0) * DAY_S
    panes: list[tuple[str, Raster | None, str]] = [
        ("how often something stands there, 0 to 1", standing, "Greys"),
        ("how much that changes, 0 to 1", changing, "OrRd"),
    ]
    panes += [
        (f"probability at {h:g} h the day after", mobility.probability(day + 3600.0 * h), "Greys")
        for h in hours
    ]
    with styled():
        rows = -(-len(panes) // 2)
        figure = Figure(figsize=(11.0, 4.4 * rows))
        grid = figure.subplots(rows, 2, squeeze=False)
        for ax, (title, raster, colours) in zip(grid.ravel(), panes, strict=False):
            assert raster is not None
            corner = raster.T_map_origin.tolist()
            drawn = _image(ax, raster.values, corner, raster.resolution_m, colours)
            figure.colorbar(drawn, ax=ax, shrink=0.8)
            ax.set(title=title, ylabel="y, m")
        for ax in grid.ravel()[len(panes) :]:
            ax.set_axis_off()
        save(figure, path)
