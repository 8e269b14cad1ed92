# SPDX-License-Identifier: Apache-2.0
"""A comparison of three SLAMs made by hand: who wins where is known, nothing is simulated."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from scripts.comparison import folder as files
from scripts.comparison import schema, tables
from scripts.days import scores
from scripts.days.lifelong import COLUMNS as SESSION
from scripts.output import write_recipe
from slam.evaluation.lost import LOST_RULE

OURS, EKF, OWN = "shunting", "ekf", "own:Hanging"
SCENE, LEVELS, SEEDS = "room", (0.0, 1.0), tuple(range(100, 106))
SCANS, BEAMS = 20, 61
# median position error, m: the EKF beats ours where nothing moves and is beaten where much does
ERROR_M = {(OURS, 0.0): 0.02, (OURS, 1.0): 0.03, (EKF, 0.0): 0.01, (EKF, 1.0): 0.3,
           (OWN, 0.0): 0.05, (OWN, 1.0): 0.05}  # fmt: skip


def make(folder: Path, seeds: tuple[int, ...] = SEEDS) -> Path:
    """Write what ``mobilia compare`` writes: tables, recipe and the files of the runs."""
    rows = [
        row_of(slam, level, seed) for level in LEVELS for seed in seeds for slam in (OURS, EKF, OWN)
    ]
    settings = {
        "compare_schema": schema.SCHEMA, "slams": [OURS, EKF, OWN], "scenes": [SCENE],
        "levels": LEVELS, "seeds": seeds, "seconds": 4.0, "every": 8, "scanner": "full",
        "scan_limit_s": 10.0, "lost_rule": LOST_RULE, "machine": {"processor": "an abacus"},
    }  # fmt: skip
    folder.mkdir(parents=True)
    write_recipe(folder, "compare", settings)
    write_tables(folder, rows)
    (folder / "runs").mkdir()
    for level in LEVELS:
        for seed in seeds:
            np.savez_compressed(folder / "runs" / f"{SCENE}_d{level:g}_s{seed}.npz", **run_of())
    return folder


def write_tables(folder: Path, rows: list[dict[str, Any]]) -> None:
    """The tables of these rows of ``runs.csv``."""
    files.write_table(folder / schema.RUNS, rows)
    files.write_table(folder / schema.LEVELS, tables.levels(rows))
    files.write_table(folder / schema.PAIRED, tables.pairs(rows))


def row_of(slam: str, level: float, seed: int) -> dict[str, Any]:
    """A row of ``runs.csv``; the guest hangs at dynamism 1."""
    error_m = ERROR_M[slam, level] * (1.0 + 0.02 * (seed - 100))
    row = {"scene": SCENE, "dynamism": level, "seed": seed, "slam": slam, "scans": SCANS,
           "ms_per_scan_p50": 2.0, "peak_memory_mb": 5.0}  # fmt: skip
    if slam == OWN and level == 1.0:
        words = f"SLAM 'own:Hanging', scan {seed - 91}, hung: no answer within <10> s"
        return row | {"outcome": "hung", "failure": words, "lost": 1, "lost_at_s": 1.8}
    return row | {
        "outcome": "finished", "lost": 0, "ate_unaligned_m": error_m, "rpe_m_per_m": 0.01,
        "heading_rmse_rad": 0.002, "nees_over_3": 1.5, "ghost_rate": 0.1,
    }  # fmt: skip


def run_of() -> dict[str, Any]:
    """The arrays of a run: a robot that drives along x in a room of 8 x 6 m, a chair, a door."""
    stamps = np.arange(SCANS, dtype=np.int64) * 200_000_000
    truth = np.tile([1.0, 3.0, 0.0], (SCANS, 1))
    truth[:, 0] += 0.1 * np.arange(SCANS)
    room = np.zeros((60, 80), np.uint8)
    room[[0, -1]] = room[:, 0] = room[:, -1] = 1
    movers = np.tile([[4.0, 2.0, 0.0], [6.0, 0.1, 1.0]], (SCANS, 1, 1))
    arrays = {
        "schema": schema.SCHEMA, "slams": np.array([OURS, EKF, OWN]), "stamps_ns": stamps,
        "truth": truth, "ranges": np.full((SCANS, BEAMS), 2.0, np.float32),
        "hit": np.zeros((SCANS, BEAMS), np.int16), "mover_poses": movers,
        "moving": np.arange(SCANS)[:, None] % 2 == [0, 0], "names": np.array(["chair1", "door1"]),
        "kinds": np.array(["chair_visitor", "door"]), "radii_m": np.array([0.3, 0.9]),
        "closed": np.zeros((2, 3)), "static_map": room, "static_map_resolution_m": 0.1,
        "T_world_origin": np.zeros(3), "laser_angle_min": -math.pi / 2,
        "laser_angle_increment": math.pi / (BEAMS - 1), "laser_range_max": 80,
        "laser_T_robot_laser": np.zeros(3),
    }  # fmt: skip
    for k, answered in enumerate((SCANS, SCANS, 9)):
        poses = truth[:answered] - truth[0] + [0.0, 0.02 * (k + 1), 0.0]
        arrays |= {
            f"slam{k}_stamps_ns": stamps[:answered], f"slam{k}_poses": poses,
            f"slam{k}_covariances": np.tile(np.eye(3) * 1e-4, (answered, 1, 1)),
            f"slam{k}_converged": np.ones(answered, np.bool_),
            f"slam{k}_milliseconds": np.ones(answered),
        }  # fmt: skip
    arrays |= {
        "slam0_map": np.where(room, 254, 255).astype(np.uint8), "slam0_map_resolution_m": 0.1,
        "slam0_T_map_origin": np.array([-1.0, -3.0, 0.0]),
    }  # fmt: skip
    return arrays


def add_days(folder: Path, buildings: int = 6) -> Path:
    """What ``mobilia compare --sessions 5`` writes besides: ours finds all, the others start anew,
    and the guest fails in one session of each building."""
    recipe = json.loads((folder / "recipe.json").read_text())
    recipe["settings"] |= {"sessions": 5, "change": 0.3}
    rows = []
    for slam in (OURS, EKF, OWN):
        for seed in range(buildings):
            sessions = [session_of(slam, k, seed) for k in range(5)]
            failure = "scan 3, raised <RuntimeError>: enough" if slam == OWN else None
            aged = [
                {"age": age, "place": "right", "rmse_m": 0.03 + 0.001 * age}
                for age in (1, 3) if slam == OURS
            ]  # fmt: skip
            for motion in LEVELS:
                of = {"scene": SCENE, "motion": motion, "change": 0.3, "seed": SEEDS[seed],
                      "slam": slam}  # fmt: skip
                rows.append(scores.of_building(of, sessions, aged, failure))
    (folder / "recipe.json").write_text(json.dumps(recipe))
    files.write_table(folder / schema.AGES, rows)
    files.write_table(folder / schema.AGES_LEVELS, scores.levels(rows))
    return folder


def session_of(slam: str, number: int, seed: int) -> dict[str, Any]:
    """A row of ``lifelong.csv``."""
    row = {
        **dict.fromkeys(SESSION), "session": number, "map": "anew", "place": "",
        "rmse_m": 0.02 + 0.005 * number + 0.001 * seed, "ms_per_scan": 2.0,
    }  # fmt: skip
    if slam == OWN and number == 2:
        return row | {"place": "failed", "rmse_m": None}
    if slam == OURS:
        row |= {
            "map": "merged" if number else "new", "place": "right", "found_after_s": 1.0 * number,
            "start": "known", "ghost_rate": 0.01 + 0.002 * number, "recall": 0.9, "map_kb": 340.0,
        }  # fmt: skip
    return row
