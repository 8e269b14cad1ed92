# SPDX-License-Identifier: Apache-2.0
"""The whole card of one scanner: every statistic under its name, in the order of the table.

An edge has nothing between its two surfaces, a mixed pixel (the spot lights both), or a lost beam.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from slam.errors import InvalidValueError
from slam.evaluation.scanner.figures import Figure, Figures, key_of, ratio
from slam.evaluation.scanner.noise import (
    COARSE,
    COARSE_BINS_M,
    RANGE_BINS_M,
    about_walls,
    codes,
    found_walls,
    standing,
)
from slam.evaluation.scanner.stretches import Stretch, stretches_of
from slam.evaluation.scanner.walls import SPLIT_M
from slam.frames import Float, LaserSpec, Stream

SIDE = 3  # beams on either side that lie together
FLAT_M = 0.15  # m between the nearest and the farthest of a side
CLEAR_M = 0.1  # m from both sides, from which a range is of neither
DEPTH_BINS_M = ((0.4, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 20.0))  # from side to side
LEAST_EDGES = 30  # below which a bin says nothing


def edges(stretches: Sequence[Stretch]) -> Figures:
    """Of edges with at most one beam between the sides, of all scans that are looked at.

    between    by their depth, the share with a range between the sides
    edge_lost  share with a beam without a return
    """
    found = [np.concatenate([_edges(scan) for scan in part.looked_at()]) for part in stretches]
    lost = [float((e[:, 1] == 2.0).sum()) for e in found]
    figures = {"edge_lost": ratio(lost, [len(e) for e in found])}
    for low, high in DEPTH_BINS_M:
        own = [e[(e[:, 0] >= low) & (e[:, 0] < high)] for e in found]
        made = ratio([float((e[:, 1] == 1.0).sum()) for e in own], [len(e) for e in own])
        figures[key_of("between", low, high)] = made.if_of(LEAST_EDGES)
    return figures


def _edges(ranges: Float) -> Float:
    """(k, 2): depth m of each edge; 0 for clean, 1 with a range between its sides, 2 lost."""
    windows = np.lib.stride_tricks.sliding_window_view(ranges, SIDE)
    low, high = windows.min(axis=1), windows.max(axis=1)  # NaN where one did not return
    flat = high - low <= FLAT_M
    rows = []
    for gap in (0, 1):
        n = len(low) - SIDE - gap
        a, b = np.arange(n), np.arange(n) + SIDE + gap
        near_right = low[a] < low[b]
        near, far = np.where(near_right, high[a], high[b]), np.where(near_right, low[b], low[a])
        depth = far - near
        edge = flat[a] & flat[b] & (depth >= DEPTH_BINS_M[0][0]) & (depth < DEPTH_BINS_M[-1][1])
        depth, near, far = depth[edge], near[edge], far[edge]
        kind = np.zeros(len(depth))
        if gap:
            own = ranges[a[edge] + SIDE]
            kind = np.where(np.isnan(own), 2.0, 0.0)
            kind[(own > near + CLEAR_M) & (own < far - CLEAR_M)] = 1.0
            depth, kind = depth[kind > 0.0], kind[kind > 0.0]
        rows.append(np.stack([depth, kind], axis=1))
    return np.concatenate(rows)


MM, PERCENT, PLAIN = "mm", "%", ""
SCALE = {MM: 1e3, PERCENT: 1e2, PLAIN: 1.0}


@dataclass(frozen=True, kw_only=True)
class Statistic:
    """One row: its key, what it is, the unit in which it is shown; a ``detail`` of another one."""

    key: str
    what: str
    unit: str
    detail: bool = False


def _bins(
    key: str, what: str, unit: str, bins: Sequence[tuple[float, float]], detail: bool = False
) -> Iterator[Statistic]:
    for low, high in bins:
        named = f"{what}, {low:g} to {high:g} m"
        yield Statistic(key=key_of(key, low, high), what=named, unit=unit, detail=detail)


def _noise(key: str, what: str) -> Iterator[Statistic]:
    yield Statistic(key=key, what=what, unit=MM)
    yield from _bins(key, what, MM, RANGE_BINS_M, detail=True)
    yield Statistic(key=f"{key}.square", what=f"{what}, incidence below 45°", unit=MM)
    yield Statistic(key=f"{key}.oblique", what=f"{what}, incidence 45° to 70°", unit=MM)


STATISTICS: tuple[Statistic, ...] = (
    Statistic(key="step", what="step of the code", unit=MM),
    *_bins("coarse", f"codes that are multiples of {COARSE} steps", PERCENT, COARSE_BINS_M),
    *_noise("standing", "noise of a standing robot"),
    *_noise("wall", "deviation about a straight wall"),
    Statistic(key="no_return", what="no return, all beams", unit=PERCENT),
    Statistic(key="holes", what="no return, within straight walls", unit=PERCENT),
    *_bins("between", "edges with a range between the sides, depth", PERCENT, DEPTH_BINS_M),
    Statistic(key="edge_lost", what="edges with a lost beam", unit=PERCENT),
)


@dataclass(frozen=True, kw_only=True)
class ScannerCard:
    """``figures`` by the keys of ``STATISTICS``, in m and shares; and what was there to measure.

    standing_scans  of ``standing_stretches``, their first and last left out
    crept           stretches that stood by odometry, but not by the ranges: refused
    """

    figures: Mapping[str, Figure]
    scans: int
    beams: int
    increment_rad: float
    blocks: int
    standing_stretches: int
    standing_scans: int
    crept: int


def measure(*streams: Stream) -> ScannerCard:
    """Every statistic of the scans of one scanner's logs; what they have too little for is NaN.

    Raises ``InvalidValueError`` for a log without scans, and for logs with different beams.
    """
    cuts = [stretches_of(stream) for stream in streams]
    spec = _one_spec([cut.spec for cut in cuts])
    parts = [part for cut in cuts for part in cut.parts]
    still = [part for part in parts if part.standing]
    figures = codes(parts)
    step = figures["step"].value
    fives = any(figures[key_of("coarse", *ends)].value > 0.5 for ends in COARSE_BINS_M)
    counted = step * (COARSE if fives else 1)
    found = [found_walls(part, spec.angles, max(SPLIT_M, 1.5 * counted)) for part in parts]
    lost = [float(np.isnan(part.ranges).sum()) for part in parts]
    holes = [sum(wall.holes for wall in part) for part in found]
    beams = [sum(wall.holes + len(wall.beams) for wall in part) for part in found]
    figures |= standing(still, spec.angles, step) | about_walls(found) | edges(parts)
    figures |= {
        "no_return": ratio(lost, [part.ranges.size for part in parts]),
        "holes": ratio(holes, beams),
    }
    return ScannerCard(
        figures=figures, scans=sum(cut.scans for cut in cuts), beams=spec.n_beams,
        increment_rad=spec.angle_increment, blocks=len(parts) - len(still),
        standing_stretches=len(still), standing_scans=sum(len(s.ranges) for s in still),
        crept=sum(cut.crept for cut in cuts),
    )  # fmt: skip


def _one_spec(specs: Sequence[LaserSpec]) -> LaserSpec:
    """The scanner of all logs."""
    if not specs:
        raise InvalidValueError("a scanner card needs a log, got none")
    first = specs[0]
    for other in specs:
        if other.n_beams != first.n_beams or not np.allclose(other.angles, first.angles, atol=1e-6):
            raise InvalidValueError(
                f"the logs must be of one scanner, got {first.n_beams} and {other.n_beams} beams, "
                f"{math.degrees(first.angle_increment):g} and "
                f"{math.degrees(other.angle_increment):g} degrees apart"
            )
    return first
