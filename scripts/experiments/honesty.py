# SPDX-License-Identifier: Apache-2.0
"""Does the SLAM say so when a crowd has carried it off, and does it come back from a push?

``python -m scripts.experiments.honesty --jobs 2``; ``--push 100`` for the pushes.

Streams are crowds on train seeds (``crowd_streams``), kept in ``--folder``. A scan is *due* that is
off by more than ``SILENT_M`` for ``DUE_S`` or longer. It is *told* where the error is within 3
sigma of the covariance of position, or the SLAM is not converged. A *false alarm* is a scan that is
less far off and not converged.

A push displaces the pose in the SLAM at a random moment between 0.3 and 0.85 of the stream, by
``PUSH_M`` in a random direction or by ``PUSH_DEG``; nothing else in it learns of that
(``Tracker.displace``). It is back when it stays within ``BACK_M`` and ``BACK_DEG`` of the run
without the push for ``STAYS_S``.

With ``--page`` the sums are written to that page, too, at its marks ``honesty`` and ``pushes``.
"""

from __future__ import annotations

import argparse
import copy
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from scripts import workers
from scripts.comparison.recording import load
from scripts.experiments.crowd_streams import SCENES, TRAIN, CrowdStream, train_streams
from scripts.experiments.measured import ended, table
from scripts.experiments.recorded import make_missing
from scripts.marks import fill_page
from scripts.metrics.judged import Judged, lost_s, world_truth
from slam import se2
from slam.answers import asked
from slam.frames import NS_PER_S, Float, Frame
from slam.oracle import shown
from slam.replay import Track
from slam.shunting import ShuntingSlam

PUSH_M, PUSH_DEG = 0.3, 5.0
BACK_M, BACK_DEG, STAYS_S = 0.05, 1.0, 1.0
WATCHED_S = 15.0  # after a push
WANTED_S = 3.0  # to be back
KINDS = ("m", "deg")
HEADS = ("", "ATE, cm", "lost", "scans due", "admitted", "false alarms", "NEES / 3")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One run, or several: error m, scans by kind, NEES / 3."""

    name: str
    ate: float
    lost: int
    due: int
    told: int
    good: int
    false: int
    nees: float

    def line(self) -> str:
        """As printed."""
        told = f"{self.told / self.due:7.3f}" if self.due else "      -"
        return (
            f"{self.name:36s}{100.0 * self.ate:8.2f}{self.lost:6d}{self.due:6d}{told}"
            f"{self.false / max(self.good, 1):8.3f}{self.nees:8.2f}"
        )

    def cells(self) -> list[str]:
        """As in the table of a page."""
        told = f"{100.0 * self.told / self.due:.1f} %" if self.due else "–"
        return [
            self.name, f"{100.0 * self.ate:.2f}", str(self.lost), str(self.due), told,
            f"{100.0 * self.false / max(self.good, 1):.2f} %", f"{self.nees:.2f}",
        ]  # fmt: skip


def judged(stream: CrowdStream, folder: Path, numbers: Mapping[str, object]) -> Row:
    """One run of the SLAM, with these numbers of its config changed."""
    frames, system = load(stream.path(folder)).frames, ShuntingSlam(numbers)
    track = Track(stream.name, system)
    for frame in frames:
        track.take(shown(system, frame))
    run = Judged.of(track, world_truth(frames))
    off, converged, due = run.is_off(), run.converged(), run.is_due()
    return Row(
        name=stream.name,
        ate=run.ate(),
        lost=int(lost_s(run.pairs, run.known) is not None),
        due=int(due.sum()),
        told=int((due & run.is_told()).sum()),
        good=int((~off).sum()),
        false=int((~off & ~converged).sum()),
        nees=run.nees_over_3() or math.nan,
    )


def overall(name: str, rows: Sequence[Row]) -> Row:
    """Geometric mean of the errors, median NEES, sums of the rest."""
    return Row(
        name=f"{name}: {len(rows)} runs",
        ate=math.exp(float(np.mean([math.log(row.ate) for row in rows]))),
        lost=sum(row.lost for row in rows),
        due=sum(row.due for row in rows),
        told=sum(row.told for row in rows),
        good=sum(row.good for row in rows),
        false=sum(row.false for row in rows),
        nees=float(np.nanmedian([row.nees for row in rows])),
    )


def pushed(job: tuple[CrowdStream, int], folder: Path) -> list[tuple[str, str, float | None]]:
    """So many pushes of each kind in one stream: what, and seconds until it is back or None."""
    stream, count = job
    frames = load(stream.path(folder)).frames
    rng = np.random.default_rng([stream.seed, round(100 * stream.motion), len(stream.scene)])
    moments = rng.integers(int(0.3 * len(frames)), int(0.85 * len(frames)), count)
    system, poses, kept = ShuntingSlam(), [], {}
    for k, frame in enumerate(frames):
        if k in moments:
            kept[k] = copy.deepcopy(system)
        poses.append(asked(system, shown(system, frame)).T_map_robot)
    found = []
    for k in moments.tolist():
        for kind in KINDS:
            system = copy.deepcopy(kept[k])
            system.displace(push(kind, rng))
            back = _back_s(system, frames[k:], poses[k:])
            found.append((f"{stream.name}, scan {k}", kind, back))
    return found


def push(kind: str, rng: np.random.Generator) -> Float:
    """(3,) m, m, rad: one of ``KINDS``, in a random direction."""
    if kind == "deg":
        return np.array([0.0, 0.0, math.radians(PUSH_DEG) * rng.choice([-1.0, 1.0])])
    way = rng.uniform(0.0, math.tau)
    return np.array([PUSH_M * math.cos(way), PUSH_M * math.sin(way), 0.0])


def _back_s(
    system: ShuntingSlam, frames: Sequence[Frame], unpushed: Sequence[Float]
) -> float | None:
    seconds, back = [], []
    for frame, pose in zip(frames, unpushed, strict=True):
        seconds.append((frame.stamp_ns - frames[0].stamp_ns) / NS_PER_S)
        if seconds[-1] > WATCHED_S:
            break
        x, y, turn = (asked(system, shown(system, frame)).T_map_robot - pose).tolist()
        near = math.hypot(x, y) < BACK_M and abs(se2.wrap(turn)) < math.radians(BACK_DEG)
        back.append(near)
    for k in range(len(back)):
        stays = [
            near
            for near, s in zip(back[k:], seconds[k:], strict=False)
            if s <= seconds[k] + STAYS_S
        ]
        if all(stays):
            return seconds[k]
    return None


def _print_runs(streams: Sequence[CrowdStream], folder: Path, wanted: argparse.Namespace) -> None:
    numbers = dict(pair.split("=", 1) for pair in wanted.set)
    changed = {path: float(value) for path, value in numbers.items()}
    print(f"{'':36s}{'ATE cm':>8s}{'lost':>6s}{'due':>6s}{'told':>7s}{'false':>8s}{'NEES/3':>8s}")
    call = partial(judged, folder=folder, numbers=changed)
    rows = sorted(workers.each(call, streams, jobs=wanted.jobs), key=lambda row: row.name)
    for row in rows:
        print(row.line())
    sums = [
        overall(f"motion {motion:g}", [r for r in rows if f"motion{motion:g}_" in r.name])
        for motion in wanted.motions
    ]
    sums += [
        overall(scene, [r for r in rows if r.name.startswith(scene)]) for scene in wanted.scenes
    ]
    sums.append(overall("all", rows))
    for row in sums:
        print(row.line())
    if wanted.page is not None:
        fill_page(wanted.page, "honesty", table(HEADS, [row.cells() for row in sums]))


def _print_pushes(streams: Sequence[CrowdStream], folder: Path, wanted: argparse.Namespace) -> None:
    shares = [
        (stream, wanted.push // len(streams) + (k < wanted.push % len(streams)))
        for k, stream in enumerate(streams)
    ]
    jobs = [share for share in shares if share[1]]
    results: Iterator[list[tuple[str, str, float | None]]] = workers.each(
        partial(pushed, folder=folder), jobs, jobs=wanted.jobs
    )
    found = sorted((one for result in results for one in result), key=lambda one: one[:2])
    for name, kind, back in found:
        if back is None or back > WANTED_S:
            print(f"{name}, {kind}: " + ("not back" if back is None else f"{back:.1f} s"))
    lines = []
    for kind, words in zip(KINDS, (f"{PUSH_M:g} m", f"{PUSH_DEG:g} degrees"), strict=True):
        times = [math.inf if back is None else back for _, other, back in found if other == kind]
        quick = sum(back <= WANTED_S for back in times)
        lines.append(f"Pushed by {words}: {quick} of {len(times)} back within {WANTED_S:g} s.")
    print("\n".join(lines))
    if wanted.page is not None:
        fill_page(wanted.page, "pushes", "\n".join(f"- {line}" for line in lines))


def main(arguments: list[str] | None = None) -> int:
    """A line for each run, or the pushes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--motions", type=float, nargs="+", default=list(TRAIN))
    parser.add_argument("--most", type=int, default=20, help="seeds of each scene and motion")
    parser.add_argument("--folder", type=Path, default=Path("out/honesty"), help="of recordings")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--page", type=Path, help="with the marks honesty and pushes")
    parser.add_argument("--push", type=int, default=0, help="so many pushes of each kind")
    parser.add_argument("--set", nargs="*", default=[], metavar="PATH=NUMBER", help="of the config")
    wanted = parser.parse_args(arguments)
    streams = train_streams(wanted.scenes, wanted.motions, wanted.most)
    make_missing(streams, wanted.folder, wanted.jobs)
    (_print_pushes if wanted.push else _print_runs)(streams, wanted.folder, wanted)
    return 0


if __name__ == "__main__":
    sys.exit(ended(main))
