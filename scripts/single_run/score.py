# SPDX-License-Identifier: Apache-2.0
"""The numbers of a run: one dictionary for ``results.json``, one table for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from scripts.console import console
from slam.evaluation import metrics
from slam.replay import Replay, Track
from slam.trajectory import Trajectory

SCHEMA = 1
WARM_UP = 5  # the first scans may compile; they are left out of the timings


def results(replay: Replay, wall_s: float, machine: Mapping[str, Any]) -> dict[str, Any]:
    """What ``results.json`` holds: a block of numbers for each SLAM, and where it was measured.

    Errors are of the online poses; ``..._final`` those of the final trajectory where a system has
    one of its own. Without truth only the timings are there.
    """
    truth = replay.truth()
    stamps = [e.stamp_ns for track in replay.tracks.values() for e in track.estimates]
    duration_s = (max(stamps) - min(stamps)) / 1e9 if stamps else 0.0
    return {
        "schema": SCHEMA,
        "duration_s": duration_s,
        "distance_m": truth.length_m() if truth is not None else None,
        "wall_s": wall_s,
        "machine": dict(machine),
        "slams": {name: scores(track, truth, duration_s) for name, track in replay.tracks.items()},
    }


def scores(track: Track, truth: Trajectory | None, duration_s: float) -> dict[str, Any]:
    """The block of one SLAM."""
    spent = np.array(track.durations_s)
    steady = spent[WARM_UP:] if len(spent) > 2 * WARM_UP else spent
    block: dict[str, Any] = {
        "scans": len(track.estimates),
        "not_converged": sum(not e.converged for e in track.estimates),
        "ms_per_scan_p50": float(np.percentile(steady, 50)) * 1e3,
        "ms_per_scan_p99": float(np.percentile(steady, 99)) * 1e3,
        "real_time_factor": duration_s / max(float(steady.mean()) * len(spent), 1e-9),
    }
    if truth is None or len(truth) < 2:
        return block
    block |= errors(track.online(), truth)
    final = track.final()
    if final is not None:
        block |= {f"{key}_final": value for key, value in errors(final, truth).items()}
    return block


def errors(estimate: Trajectory, truth: Trajectory) -> dict[str, Any]:
    """Position and heading errors, and the paper's statistics per x, y, theta (unaligned)."""
    statistics = metrics.error_statistics(estimate, truth)
    pairs = metrics.pose_errors(estimate, truth)
    block: dict[str, Any] = {
        "ate_unaligned_m": metrics.ate(estimate, truth).value,
        "ate_se2_m": metrics.ate(estimate, truth, align="se2").value,
        "heading_rmse_rad": metrics.heading_rmse(estimate, truth).value,
        "end_error_m": float(np.hypot(*pairs.errors[-1, :2])),
    }
    for k, axis in enumerate(("x", "y", "theta")):
        block[f"mean_e_{axis}"] = float(statistics.mean[k])
        block[f"var_e_{axis}"] = float(statistics.var_e[k])
        block[f"var_p_{axis}"] = float(statistics.var_p[k])
    return block


_ROWS = (
    ("ATE, unaligned", "ate_unaligned_m", "m", "{:.4f}"),
    ("ATE, SE(2)-aligned", "ate_se2_m", "m", "{:.4f}"),
    ("heading RMSE, unaligned", "heading_rmse_rad", "rad", "{:.5f}"),
    ("error at the end, unaligned", "end_error_m", "m", "{:.4f}"),
    ("mean(e) x", "mean_e_x", "m", "{:+.4f}"),
    ("mean(e) y", "mean_e_y", "m", "{:+.4f}"),
    ("mean(e) theta", "mean_e_theta", "rad", "{:+.5f}"),
    ("var(e) x", "var_e_x", "m²", "{:.2e}"),
    ("var(e) y", "var_e_y", "m²", "{:.2e}"),
    ("var(e) theta", "var_e_theta", "rad²", "{:.2e}"),
    ("var(p) x", "var_p_x", "m²", "{:.2e}"),
    ("var(p) y", "var_p_y", "m²", "{:.2e}"),
    ("var(p) theta", "var_p_theta", "rad²", "{:.2e}"),
    ("CPU per scan, p50", "ms_per_scan_p50", "ms", "{:.2f}"),
    ("CPU per scan, p99", "ms_per_scan_p99", "ms", "{:.2f}"),
    ("real-time factor of the SLAM", "real_time_factor", "×", "{:.1f}"),
    ("scans it did not trust", "not_converged", "", "{:d}"),
)


def print_table(outcome: Mapping[str, Any], title: str) -> None:
    """One column for each SLAM (and one for its final trajectory), one row for each number."""
    columns: list[tuple[str, Mapping[str, Any], str]] = []
    for name, block in outcome["slams"].items():
        columns.append((name, block, ""))
        if "ate_unaligned_m_final" in block:
            columns.append((f"{name}, final", block, "_final"))
    table = Table(title=escape(title), title_justify="left", caption=_caption(outcome))
    table.add_column("online; unaligned: in the frame of the first pose")
    table.add_column("unit")
    for heading, _, _ in columns:
        table.add_column(escape(heading), justify="right")
    for label, key, unit, form in _ROWS:
        cells = [
            form.format(block[key + suffix]) if key + suffix in block else ""
            for _, block, suffix in columns
        ]
        if any(cells):
            table.add_row(label, unit, *cells)
    console.print(table)


def _caption(outcome: Mapping[str, Any]) -> str:
    length = outcome["distance_m"]
    driven = f", {length:.1f} m driven" if length is not None else ""
    return f"{outcome['duration_s']:.1f} s{driven}; CPU on {outcome['machine']['processor']}"
