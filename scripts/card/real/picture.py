# SPDX-License-Identifier: Apache-2.0
"""The picture of several cards: noise, deviation about walls, edges, and lost beams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture

from scripts.figures import save, styled
from slam.evaluation.scanner.card import ScannerCard
from slam.evaluation.scanner.edges import DEPTH_BINS_M
from slam.evaluation.scanner.figures import Figure
from slam.evaluation.scanner.noise import RANGE_BINS_M

COLORS = ("#1f61be", "#168c5a", "#de6e18", "#7a3fb0", "#59616e")
OURS = "#ce2c3c"
MARKS = ("s", "^", "D")  # of ours
APART = 0.11  # of a group's width, from card to card
Cards = Mapping[str, ScannerCard]


@styled({"font.size": 9})
def draw(path: Path, real: Cards, ours: Cards) -> None:
    """Write it as a PNG; the colours of real cards are their order's, those of ours are reds."""
    picture = Picture(figsize=(10.0, 7.2), layout="constrained")
    panels = picture.subplots(2, 2)
    _by_range(panels[0, 0], "standing", real, ours, "Noise from scan to scan, robot at rest")
    _by_range(panels[0, 1], "wall", real, ours, "Deviation about straight walls")
    _edges(panels[1, 0], real, ours)
    _shares(panels[1, 1], real, ours)
    handles, names = panels[0, 1].get_legend_handles_labels()
    picture.legend(handles, names, loc="outside lower center", ncols=4, frameon=False)
    save(picture, path)


def _all(real: Cards, ours: Cards) -> list[tuple[str, ScannerCard, str, str]]:
    """Name, card, colour, marker."""
    rows = [(n, c, COLORS[k % len(COLORS)], "o") for k, (n, c) in enumerate(real.items())]
    mine = enumerate(ours.items())
    return rows + [(n, c, OURS, MARKS[k % len(MARKS)]) for k, (n, c) in mine]


def _groups(
    ax: Axes, keys: Sequence[str], words: Sequence[str], scale: float, real: Cards, ours: Cards
) -> None:
    """One group of points a key."""
    everyone = _all(real, ours)
    for k, (name, card, color, marker) in enumerate(everyone):
        at = [i + APART * (k - 0.5 * (len(everyone) - 1)) for i in range(len(keys))]
        look = {"color": color, "fmt": marker, "label": name}
        _points(ax, at, [card.figures[key] for key in keys], scale, look)
    ax.grid(visible=False, axis="x")
    for i in range(1, len(keys)):
        ax.axvline(i - 0.5, color="#bbbbbb", lw=0.8)
    ax.set_xlim(-0.5, len(keys) - 0.5)
    ax.set_xticks(range(len(keys)), words)
    ax.tick_params(axis="x", length=0)


def _points(
    ax: Axes, at: Sequence[float], figures: Sequence[Figure], scale: float, look: dict[str, Any]
) -> None:
    value = scale * np.array([f.value for f in figures])
    low = value - scale * np.array([f.low for f in figures])
    high = scale * np.array([f.high for f in figures]) - value
    reach = np.nan_to_num(np.maximum([low, high], 0.0))
    ax.errorbar(at, value, yerr=reach, capsize=2.5, ms=4.5, lw=1.1, **look)


def _by_range(ax: Axes, key: str, real: Cards, ours: Cards, title: str) -> None:
    seen = [
        f"{low:g}-{high:g}"
        for low, high in RANGE_BINS_M
        if any(c.figures[f"{key}.{low:g}-{high:g}"].n for c in (*real.values(), *ours.values()))
    ]
    words = [bin_.replace("-", "–") for bin_ in seen]
    _groups(ax, [f"{key}.{bin_}" for bin_ in seen], words, 1e3, real, ours)
    ax.set(title=title, xlabel="range in m", ylabel="one sigma, mm", ylim=(0.0, None))


def _edges(ax: Axes, real: Cards, ours: Cards) -> None:
    bins = [f"{low:g}-{high:g}" for low, high in DEPTH_BINS_M]
    words = [bin_.replace("-", "–") for bin_ in bins]
    _groups(ax, [f"between.{bin_}" for bin_ in bins], words, 1e2, real, ours)
    ax.set(title="Edges with a range between their sides", xlabel="depth of the edge in m",
           ylabel="share of edges, %", ylim=(0.0, None))  # fmt: skip


SHARES = (
    ("no_return", "no return,\nall beams"), ("holes", "no return,\nin walls"),
    ("edge_lost", "lost beam\nat an edge"), ("edge_jumps", "edge beams\nthat move 5 cm"),
)  # fmt: skip


def _shares(ax: Axes, real: Cards, ours: Cards) -> None:
    _groups(ax, [key for key, _ in SHARES], [words for _, words in SHARES], 1e2, real, ours)
    tallest = max(
        (1e2 * figure.value for card in (*real.values(), *ours.values())
         for figure in (card.figures[key] for key, _ in SHARES) if figure.n), default=1.0,
    )  # fmt: skip
    ax.set(title="Lost beams, and edges that do not stay", ylabel="share, %")
    ax.set_yscale("symlog", linthresh=0.1)
    ax.set_ylim(-0.01, 2.0 * max(tallest, 1.0))
    ax.set_yticks([0.0, 0.1, 1.0, 10.0, *([50.0] if tallest > 25.0 else [])])
    ax.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
