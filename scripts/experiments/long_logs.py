# SPDX-License-Identifier: Apache-2.0
"""What do long logs cost, stage by stage? ``python -m scripts.experiments.long_logs [LOG...]``.

Runs ``mobilia run SLAM --log`` on each log and prints processor seconds and the most memory of each
stage: input (the log read), SLAM (with the loops closed at the end), map (its files), pictures,
film (ffmpeg's seconds included, not its memory) and the rest of what happens at a scan. Memory is
all that the process holds. Without a log it makes two: a robot drives down a street of houses,
``--metres`` far in ``--scans`` scans, round a corner or along the diagonal of the map, whose raster
is then almost all empty.

Exit status 1 where map, pictures, film and the rest together cost more than the SLAM.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from scripts.console import console
from scripts.single_run.recorded import Log, on_log
from slam import se2
from slam.frames import Float

COURSES = {"corner": (0.0, 90.0), "diagonal": (45.0,)}  # headings of the legs, degrees
BEAMS, STEP_DEG, RANGE_MAX_M = 361, 0.5, 80.0
RANGE_SIGMA_M = 0.01
SCANS_PER_S = 2.0
# of the odometry, per metre driven: scale, sideways (m), heading (rad)
DRIFT = (0.005, 0.002, 0.001)
HOUSE_M = 18.0  # of street for a house and the gap beside it
KERB_M = (5.0, 9.0)  # from the middle of the street to a house


def course(scans: int, metres: float, name: str) -> Float:
    """(scans, 3) true poses, m and rad: equal steps along legs of equal length."""
    headings = np.radians(COURSES[name])
    leg_m = metres / len(headings)
    along = np.linspace(0.0, metres, scans)
    leg = np.minimum((along / leg_m).astype(int), len(headings) - 1)
    ways = np.stack([np.cos(headings), np.sin(headings)], axis=1)
    corners = np.vstack([np.zeros(2), np.cumsum(ways * leg_m, axis=0)])
    xy = corners[leg] + ways[leg] * (along - leg * leg_m)[:, None]
    poses = np.column_stack([xy, headings[leg]])
    poses[0, 2] = 0.0  # the first pose is the map's frame: the first leg begins with a turn in it
    return poses


def houses(path: Float, rng: np.random.Generator) -> NDArray[np.float64]:
    """(n, 4) walls x0, y0, x1, y1 (m): three of each house on both sides of the path."""
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
    walls = []
    for at in np.arange(-HOUSE_M, driven[-1] + HOUSE_M, HOUSE_M):
        here = path[int(np.searchsorted(driven, at, side="right")) - 1 if at > 0.0 else 0].copy()
        here[:2] += (at - np.interp(at, driven, driven)) * np.array(
            [np.cos(here[2]), np.sin(here[2])]
        )
        for side in (-1.0, 1.0):
            near, long = side * rng.uniform(*KERB_M), HOUSE_M * rng.uniform(0.4, 0.8)
            local = np.array([[0.0, 3.0 * near], [0.0, near], [long, near], [long, 3.0 * near]])
            corners = se2.transform(here, local)
            beside = np.linspace(0.0, 1.0, 9)[:, None, None]
            points = (corners[:-1] + beside * np.diff(corners, axis=0)).reshape(-1, 2)
            gaps = np.linalg.norm(points[:, None] - path[None, ::4, :2], axis=2)
            if gaps.min() > 0.9 * KERB_M[0]:  # not in the other leg's way
                walls.append(np.hstack([corners[:-1], corners[1:]]))
    return np.vstack(walls)


def scan(pose: Float, walls: NDArray[np.float64], rng: np.random.Generator) -> Float:
    """(BEAMS,) ranges, m; the maximum where no wall is."""
    angles = pose[2] + np.radians(STEP_DEG) * (np.arange(BEAMS) - BEAMS // 2)
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    start, along = walls[:, :2] - pose[:2], walls[:, 2:] - walls[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = ways[:, :1] * along[:, 1] - ways[:, 1:] * along[:, 0]
        reach = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        share = (start[:, 0] * ways[:, 1:] - start[:, 1] * ways[:, :1]) / cross
    reach[~((share >= 0.0) & (share <= 1.0) & (reach > 0.0))] = np.inf
    noisy = reach.min(axis=1) + rng.normal(0.0, RANGE_SIGMA_M, BEAMS)
    ranges: Float = np.minimum(noisy, RANGE_MAX_M)
    return ranges


def lines(scans: int, metres: float, name: str, seed: int) -> Iterator[str]:
    """A CARMEN log with the true poses as its corrected ones."""
    rng = np.random.default_rng(seed)
    path = course(scans, metres, name)
    walls = houses(path, rng)
    T_odom_robot, before = np.zeros(3), path[0]
    for number, pose in enumerate(path):
        step = se2.between(before, pose)
        driven, before = float(np.hypot(*step[:2])), pose
        step = step + driven * rng.normal(0.0, DRIFT)
        T_odom_robot = se2.compose(T_odom_robot, step)
        ranges = " ".join(f"{r:.2f}" for r in scan(pose, walls, rng))
        places = " ".join(f"{value:.5f}" for value in (*pose, *T_odom_robot))
        stamp = f"{number / SCANS_PER_S:.3f}"
        yield f"FLASER {BEAMS} {ranges} {places} {stamp} street {stamp}\n"


def write(path: Path, scans: int, metres: float, name: str, seed: int = 0) -> None:
    """The made log as a file."""
    path.write_text("".join(lines(scans, metres, name, seed)), encoding="ascii")


def table(log: Path, slam: str, film: bool, repeats: int) -> bool:
    """Print the stages of one run, medians of ``repeats``; whether pictures cost less than the
    SLAM."""
    results = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder, console.capture():
            results.append(
                on_log([slam], Log(path=log), Path(folder) / "run", overwrite=False, film=film)
            )
    result, costs = results[0], [result["cost"] for result in results]
    pictures_s, slam_s = (median(c[key] for c in costs) for key in ("pictures_s", "slam_s"))
    stages = [
        (name, *(median(c["stages"][name][key] for c in costs) for key in ("s", "memory_mb")))
        for name in costs[0]["stages"]
    ]
    distance_m = result["distance_m"]
    driven = "" if distance_m is None else f", {distance_m:.0f} m driven"
    of = "" if repeats == 1 else f", medians of {repeats} runs"
    well = bool(pictures_s <= slam_s)
    lines = [
        f"{log.name}: {result['slams'][slam]['scans']} scans{driven}, {slam}{of}",
        f"  {'stage':10}{'s':>8}{'MB':>8}",
        *(f"  {name:10}{seconds:>8.1f}{memory_mb:>8.0f}" for name, seconds, memory_mb in stages),
        f"  pictures in all {pictures_s:.1f} s for {slam_s:.1f} s of SLAM, "
        f"{median(c['pictures_s'] / c['slam_s'] for c in costs):.2f} of it"
        f"{'' if well else ': MORE THAN THE SLAM'}; memory at most "
        f"{max(c['memory_mb'] for c in costs)} MB",
    ]
    console.print("\n".join(lines), soft_wrap=True, highlight=False)
    return well


def main(words: Sequence[str] | None = None) -> int:
    """The exit status."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", nargs="*", type=Path, help="any log that mobilia run --log reads")
    parser.add_argument("--slam", default="shunting")
    parser.add_argument("--scans", type=int, default=860, help="of a made log")
    parser.add_argument("--metres", type=float, default=810.0, help="driven in a made log")
    parser.add_argument("--repeats", type=int, default=1, help="runs of each log")
    parser.add_argument("--no-film", action="store_true")
    options = parser.parse_args(words)
    warm(options.slam)
    with tempfile.TemporaryDirectory() as folder:
        made = {} if options.logs else {n: Path(folder) / f"made-{n}.log" for n in COURSES}
        for name, log in made.items():
            write(log, options.scans, options.metres, name)
        logs = options.logs or made.values()
        well = [table(log, options.slam, not options.no_film, options.repeats) for log in logs]
    return 0 if all(well) else 1


def warm(slam: str) -> None:
    """Load and compile all that the first run in a process loads and compiles."""
    with tempfile.TemporaryDirectory() as folder, console.capture():
        write(Path(folder) / "warm.log", 20, 20.0, "corner")
        on_log(
            [slam],
            Log(path=Path(folder) / "warm.log"),
            Path(folder) / "out",
            overwrite=False,
            film=True,
        )


if __name__ == "__main__":
    sys.exit(main())
