# SPDX-License-Identifier: Apache-2.0
"""The card of logs, and that of a simulated scanner like the one that made them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scripts.card.real.simulated import Simulated, simulated
from sim.sensors.lidar.models.lms221 import SCAN_MODES
from sim.sensors.lidar.registry import DEFAULT, scanner_of
from slam.evaluation.scanner.card import ScannerCard, measure
from slam.evaluation.scanner.edges import mixed_beams
from slam.logs import open_log


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
    return measure(simulated(scanner_of(scanner)).stream)


def between_that_mix(made: Simulated) -> tuple[int, int]:
    """Of simulated beams with a range between two sides: how many mix two surfaces; how many."""
    mix = beams = 0
    for frame, mixed in zip(made.stream, made.mixed, strict=True):
        assert frame.scan is not None
        found = mixed_beams(np.where(frame.scan.valid, frame.scan.ranges, np.nan))
        mix, beams = mix + int(mixed[found].sum()), beams + len(found)
    return mix, beams
