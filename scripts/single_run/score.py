# SPDX-License-Identifier: Apache-2.0
"""The numbers of a run: one dictionary for ``results.json``, one table for people."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from scripts.metrics.judged import Judged
from scripts.metrics.table import IN_RUN, digits, minus
from slam.days.session import searched
from slam.evaluation.consistency import KeptScans
from slam.replay import Replay, Track
from slam.trajectory import Trajectory

SCHEMA = 1
WARM_UP = 5  # the first scans may compile; they are left out of the timings


def results(
    replay: Replay, wall_s: float, machine: Mapping[str, Any], kept: KeptScans
) -> dict[str, Any]:
    """What ``results.json`` holds: a block of numbers for each SLAM, and where it was measured.

    Errors are of the online poses; ``..._final`` those of the final trajectory where a system has
    one of its own. Without truth only the timings are there, and how well the poses agree with
    each other, where scans were ``kept`` to say it.
    """
    truth = replay.truth()
    stamps = [e.stamp_ns for track in replay.tracks.values() for e in track.estimates]
    duration_s = (max(stamps) - min(stamps)) / 1e9 if stamps else 0.0
    blocks = {name: scores(track, truth, duration_s) for name, track in replay.tracks.items()}
    for name, track in replay.tracks.items():
        found = kept.judged((track.final() or track.online()).poses)
        if found is not None:
            blocks[name]["consistency"] = found.block()
    return {
        "schema": SCHEMA,
        "duration_s": duration_s,
        "distance_m": truth.length_m() if truth is not None else None,
        "wall_s": wall_s,
        "machine": dict(machine),
        "slams": blocks,
    }


def scores(track: Track, truth: Trajectory | None, duration_s: float) -> dict[str, Any]:
    """The block of one SLAM."""
    spent = np.array(track.durations_s)
    spent = spent[np.isfinite(spent)]  # of a SLAM that ran elsewhere nothing is known
    judged = replace(
        Judged.of(track, truth if truth is not None and len(truth) >= 2 else None),
        steady_s=spent[WARM_UP:] if len(spent) > 2 * WARM_UP else spent,
        duration_s=duration_s,
    )
    block = {"scans": len(track.estimates), **_block(judged)}
    if looked := searched(track.estimates):
        block["searched"] = looked
    final = track.final() if judged.truth is not None else None
    if final is not None:
        errors = _block(Judged(estimate=final, truth=truth), section="errors")
        block |= {f"{key}_final": value for key, value in errors.items()}
    return block


def agreement_words(outcome: Mapping[str, Any]) -> str:
    """How well each SLAM's poses agree with each other, in a sentence; "" where nobody can say."""
    parts = []
    for name, block in outcome["slams"].items():
        found = block.get("consistency")
        if found is None:
            continue
        apart, beside = found["apart_cm"], found["neighbours_cm"]
        revisits = "no place seen twice"
        if apart is not None and beside is not None:
            near = f"{apart:.1f} cm apart (neighbours {beside:.1f})"
            revisits = f"{found['revisits']} revisits {near}"
        sharper = f"map {found['sharper_nats']:.2f} nats sharper than shuffled"
        parts.append(f"{name}: {revisits}, {sharper}")
    return "Without truth: " + "; ".join(parts) + "." if parts else ""


def _block(judged: Judged, section: str = "") -> dict[str, Any]:
    """The metrics that a run has, all or one section of them, those without a value left out."""
    values = {m.in_run: m.of(judged) for m in IN_RUN if section in ("", m.section)}
    return {key: value for key, value in values.items() if value is not None}


def said(outcome: Mapping[str, Any], primary: str, truth_name: str) -> list[str]:
    """What came out for the SLAM ``primary``, beside odometry, and how often it was in doubt."""
    own, others = outcome["slams"][primary], dict(outcome["slams"])
    if "ate_unaligned_m" in own:
        off = {name: _length(block["end_error_m"]) for name, block in others.items()}
        beside = "".join(f", `{k}` by {v}" for k, v in off.items() if k != primary)
        reference = "" if truth_name == "truth" else f"Against the {truth_name}, "
        first = (
            f"{reference}`{primary}` was off by {_length(own['ate_unaligned_m'])} on average "
            f"(RMSE) over {_metres(outcome['distance_m'])}; at the end by {off[primary]}{beside}."
        )
    else:
        plural = "" if own["scans"] == 1 else "s"
        first = f"`{primary}` ran through {own['scans']} scan{plural}; without truth, no errors."
    looked, scans = own.get("searched", 0), own["scans"]
    doubted = own.get("not_converged", 0) - looked
    looking = f"It looked for its start in the map for {looked} of {scans} scans."
    doubting = f"It did not trust {doubted} of {scans} scans."
    return [first, *[looking] * (looked > 0), *[doubting] * (doubted > 0)]


def _length(metres: float) -> str:
    return f"{digits(metres)} m" if metres >= 10.0 else f"{digits(100.0 * metres)} cm"


def _metres(driven: float) -> str:
    return f"{driven:.{0 if driven >= 10.0 else 1}f} m"


def table(outcome: Mapping[str, Any], title: str) -> Table:
    """One column for each SLAM (and one for its final trajectory), one row for each number."""
    columns: list[tuple[str, Mapping[str, Any], str]] = []
    for name, block in outcome["slams"].items():
        columns.append((name, block, ""))
        if "ate_unaligned_m_final" in block:
            columns.append((f"{name}, final", block, "_final"))
    found = Table(title=escape(title), title_justify="left", caption=_caption(outcome))
    found.add_column("online; unaligned: in the frame of the first pose")
    found.add_column("unit")
    for heading, _, _ in columns:
        found.add_column(escape(heading), justify="right")
    for metric in IN_RUN:
        key = metric.in_run
        cells = [
            minus(metric.form.format(block[key + suffix])) if key + suffix in block else ""
            for _, block, suffix in columns
        ]
        if any(cells):
            found.add_row(metric.label, metric.unit, *cells)
    return found


def _caption(outcome: Mapping[str, Any]) -> str:
    length = outcome["distance_m"]
    driven = f", {length:.1f} m driven" if length is not None else ""
    return f"{outcome['duration_s']:.1f} s{driven}; CPU on {outcome['machine']['processor']}"
