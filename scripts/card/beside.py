# SPDX-License-Identifier: Apache-2.0
"""Cards of real and simulated scanners side by side: made, as a table, as a picture."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture

from scripts.figures import save, styled
from scripts.pages.table import NONE, Cell, Table
from sim.driving.pilot import Pilot
from sim.gym.goals import Ground
from sim.sensors.lidar.models.lms221 import SCAN_MODES
from sim.sensors.lidar.registry import DEFAULT, ScannerConfig, scanner_of
from sim.simulation import Simulation, n_frames
from slam.evaluation.scanner.card import (
    DEPTH_BINS_M,
    PLAIN,
    SCALE,
    STATISTICS,
    ScannerCard,
    measure,
)
from slam.evaluation.scanner.figures import Figure, apart, key_of
from slam.evaluation.scanner.noise import RANGE_BINS_M
from slam.frames import Frame, LaserSpec, Odometry, Stream, StreamMetadata
from slam.logs import open_log

SCENES = ("corridor", "office", "classroom", "gallery")
SEED = 18
PLACES = 12  # a scene, where the robot stands
STANDING = 16  # scans at each
DRIVEN_S = 20.0  # s of a tour of each scene
RATE_HZ = 5.0  # of the scans of the tour that are used, as real logs have


def real_card(
    logs: Sequence[Path], *, text_format: Path | None = None, strict: bool = False
) -> ScannerCard:
    """Of the logs of one scanner. Raises ``LogFormatError`` and what ``measure`` raises."""
    return measure(*(open_log(log, strict=strict, text_format=text_format) for log in logs))


def like(card: ScannerCard, scanner: str) -> str:
    """``scanner``, the default one with the log's angle between beams if it has such a mode."""
    if scanner != DEFAULT:
        return scanner
    degrees = math.degrees(card.increment_rad)
    mode = next((m for m in SCAN_MODES if math.isclose(m, degrees, rel_tol=0.01)), None)
    return scanner if mode is None else f"{scanner}(resolution_deg={mode:g})"


def simulated_card(scanner: str) -> ScannerCard:
    """Of a simulated scanner, by name, in static scenes."""
    return measure(simulated(scanner_of(scanner)))


def simulated(
    scanner: ScannerConfig, *, scenes: tuple[str, ...] = SCENES, places: int = PLACES,
    driven_s: float = DRIVEN_S,
) -> Stream:  # fmt: skip
    """Scans of ``scanner`` where all but the robot rests; the odometry of the frames is the truth.

    The robot stands at random ``places`` of each scene, and then drives.
    """
    frames: list[Frame] = []
    spec: LaserSpec | None = None
    for number, scene in enumerate(scenes):
        simulation = Simulation(
            scene, seed=SEED + number, dynamism=0.0, laser=scanner, odometry="ideal"
        )
        spec = spec or simulation.spec
        for frame in _scans(simulation, np.random.default_rng([SEED, number]), places, driven_s):
            assert frame.scan is not None
            assert frame.truth is not None
            wheels = Odometry(stamp_ns=frame.stamp_ns, T_odom_robot=frame.truth)
            frames.append(replace(frame, odometry=wheels, scan=replace(frame.scan, spec=spec)))
    metadata = StreamMetadata(source="simulation", laser=spec)
    return Stream(metadata=metadata, frames=lambda: frames, length=len(frames))


def _scans(
    simulation: Simulation, rng: np.random.Generator, places: int, driven_s: float
) -> Iterator[Frame]:
    """First the places, then the tour from where it began."""
    world, period_s = simulation.world, simulation.scan_period_s
    ground, start = Ground(world), world.robot_pose()
    for _ in range(places):
        x, y = ground.drawn(rng)
        world.carry((x, y, float(rng.uniform(-math.pi, math.pi))))
        simulation.sense()  # begun before the robot was carried
        for _ in range(STANDING):
            yield simulation.observe()
    world.carry(start)
    pilot, every = Pilot(world), max(1, round(1.0 / (RATE_HZ * period_s)))
    for number in range(n_frames(driven_s, period_s)):
        world.set_command(*pilot.command(period_s))
        frame = simulation.observe()
        if number % every == 0:
            yield frame


DIFFERS, AGREES = "≠", "="
_VERDICTS = {None: "", True: DIFFERS, False: AGREES}
CAPTION = "value (95 % interval, whole stretches drawn again); ≠: the intervals do not meet"
COLORS = ("#1f61be", "#168c5a", "#de6e18", "#7a3fb0", "#59616e")
OURS = "#ce2c3c"
MARKS = ("s", "^", "D")  # of ours
APART = 0.11  # of a group's width, from card to card
Cards = dict[str, ScannerCard]


def cell(figure: Figure, unit: str) -> str:
    """``value (low to high)`` in that unit; a dash where nothing was measured."""
    if not math.isfinite(figure.value):
        return NONE
    if figure.value == 0.0:
        return "0"
    scale = SCALE[unit]
    digits = 2 if unit == PLAIN or 0.0 < scale * figure.value < 0.1 else 1
    value, low, high = (
        f"{scale * number:.{digits}f}" for number in (figure.value, figure.low, figure.high)
    )
    return f"{value} ({low} to {high})" if figure.has_interval else value


def table(real: Cards, ours: Cards, *, details: bool = True) -> Table:
    """Every statistic that one of the real cards has; ``details``: also range by range.

    Each real card is followed by its verdict against the first of ours: ≠ where the intervals do
    not meet, = where they do, empty where one of them has none.
    """
    rows = []
    for statistic in STATISTICS:
        mine = [card.figures[statistic.key] for card in ours.values()]
        theirs = [card.figures[statistic.key] for card in real.values()]
        known = any(math.isfinite(figure.value) for figure in theirs)
        if not known or (statistic.detail and not details):
            continue
        row = [statistic.what, statistic.unit]
        for figure in theirs:
            row += [cell(figure, statistic.unit), _VERDICTS[apart(figure, mine[0])]]
        row += [cell(figure, statistic.unit) for figure in mine]
        rows.append([Cell(text=text) for text in row])
    head = ["", "unit", *(name for log in real for name in (log, "")), *ours]
    return Table(caption=CAPTION, head=head, rows=rows, words=len(head))


def markdown(real: Cards, ours: Cards) -> str:
    """The table without details, then what was there to measure."""
    lines = (f"- {name}: {amount(card)}." for name, card in (real | ours).items())
    return "\n".join([table(real, ours, details=False).markdown(), "", *lines])


def amount(card: ScannerCard) -> str:
    """What a card is of, in words."""
    crept = f"; {card.crept} more not used, as their ranges moved" if card.crept else ""
    return (
        f"{card.scans} scans of {card.beams} beams, {math.degrees(card.increment_rad):g}° apart; "
        f"{card.blocks} blocks while driving; {card.standing_stretches} standing stretches "
        f"({card.standing_scans} scans){crept}"
    )


@styled({"font.size": 9})
def draw(path: Path, real: Cards, ours: Cards) -> None:
    """Noise, deviation about walls and edges as a PNG; ours are red."""
    picture = Picture(figsize=(13.0, 4.4), layout="constrained")
    panels = picture.subplots(1, 3)
    for ax, key, bins, unit, title in zip(
        panels, ("standing", "wall", "between"), (RANGE_BINS_M, RANGE_BINS_M, DEPTH_BINS_M),
        ("one sigma, mm", "one sigma, mm", "share of edges, %"),
        ("Noise from scan to scan, robot at rest", "Deviation about straight walls",
         "Edges with a range between their sides"), strict=True,
    ):  # fmt: skip
        words = {key_of(key, *ends): f"{ends[0]:g}–{ends[1]:g}" for ends in bins}
        every = (real | ours).values()
        words = {bin_: w for bin_, w in words.items() if any(c.figures[bin_].n for c in every)}
        _groups(ax, words, 1e2 if key == "between" else 1e3, real, ours)
        what = "depth of the edge in m" if key == "between" else "range in m"
        ax.set(title=title, xlabel=what, ylabel=unit, ylim=(0.0, None))
    handles, names = panels[1].get_legend_handles_labels()
    picture.legend(handles, names, loc="outside lower center", ncols=4, frameon=False)
    save(picture, path)


def _groups(ax: Axes, words: Mapping[str, str], scale: float, real: Cards, ours: Cards) -> None:
    """One group of points a key of ``words``."""
    looks = [(COLORS[k % len(COLORS)], "o") for k in range(len(real))]
    looks += [(OURS, MARKS[k % len(MARKS)]) for k in range(len(ours))]
    for k, ((name, card), (color, mark)) in enumerate(
        zip((real | ours).items(), looks, strict=True)
    ):
        at = np.arange(len(words)) + APART * (k - 0.5 * (len(looks) - 1))
        figures = [card.figures[key] for key in words]
        value, low, high = scale * np.array([(f.value, f.low, f.high) for f in figures]).T
        reach = np.nan_to_num(np.maximum([value - low, high - value], 0.0))
        ax.errorbar(at, value, yerr=reach, capsize=2.5, ms=4.5, lw=1.1, color=color, fmt=mark,
                    label=name)  # fmt: skip
    ax.grid(visible=False, axis="x")
    for i in range(1, len(words)):
        ax.axvline(i - 0.5, color="#bbbbbb", lw=0.8)
    ax.set_xlim(-0.5, len(words) - 0.5)
    ax.set_xticks(range(len(words)), list(words.values()))
    ax.tick_params(axis="x", length=0)
