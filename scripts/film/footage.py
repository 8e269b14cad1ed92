# SPDX-License-Identifier: Apache-2.0
"""What can be filmed: a run's folder, a dataset's episode, a log, or a simulation at hand."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenes import is_file
from scripts.comparison.again import Again, again
from scripts.film.encode import SIZE, Pace, Size
from scripts.film.show import Show
from scripts.film.stage import Room, Stage
from scripts.names import is_run
from scripts.output import RECIPE
from sim.moments import Moment, toured
from sim.recording.sums import check_vouched
from sim.recording.verify import check_bag
from sim.simulation import Simulation, n_frames
from sim.twins.cut import WHOLE, Cut, Thin
from sim.twins.twins import Twins
from sim.view.moment import Moments
from slam.errors import (
    InvalidValueError,
    LogFormatError,
    NeedsLabelsError,
    UnknownNameError,
    printable,
)
from slam.frames import NS_PER_S, Float, Stream
from slam.logs import open_log
from slam.logs.bag import read_bag
from slam.logs.bag_topics import Asked, is_bag
from slam.logs.mounting import MountingTest, remounted
from slam.logs.together import together
from slam.oracle import Oracle
from slam.replay import Replay, systems_named

KNOBS = ("motion", "change", "crowd")  # of a run's settings
FEW_RETURNS = 0.1  # share of the beams of a scan; fewer return: the scan is as good as empty


@dataclass(eq=False, kw_only=True)
class Footage:
    """Frames, and what a film of them shows beside the SLAM.

    title    scene, dynamism and seed, or the log's name
    truth_name  what the film calls the truth
    slam     the SLAM that the run was about, "" where nobody says
    made_with  what the simulation was made with, for a recipe
    scans    of a log, how many
    tested   of a log, what says how its scanners are mounted, by ``LaserSpec.mount``
    empty    of a log, share of its scans with next to no returns
    usual_m  of a log, the median range
    """

    stream: Stream
    stage: Stage
    title: str
    duration_s: float
    truth_name: str = "truth"
    slam: str = ""
    scans: int = 0
    empty: float = 0.0
    usual_m: float = 0.0
    tested: Mapping[tuple[float, ...], MountingTest] = field(default_factory=dict)
    made_with: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.title = printable(self.title)  # a file may be called anything

    def show(self, slams: Sequence[str], *, pace: Pace | None = None, size: Size = SIZE) -> Show:
        """A show of the first of ``slams``, with the others and odometry beside it.

        Raises ``NeedsLabelsError`` for an oracle on frames without labels.
        """
        replay = Replay.of(systems_named(slams))
        for name, track in replay.tracks.items():
            if isinstance(track.system, Oracle) and not self.stage.labelled:
                raise NeedsLabelsError(
                    f"{name}: {self.title} has no labels to take movers' returns out by. "
                    "A simulated scene has them (--scene), and a bag of 'mobilia generate'."
                )
        return Show(
            moments=Moments(replay, truth_name=self.truth_name),
            stage=self.stage,
            title=self.title,
            duration_s=self.duration_s,
            pace=pace or Pace.within_a_minute(self.duration_s),
            size=size,
        )

    @property
    def no_camera(self) -> str:
        """Why there is no 3D view although one was wanted; empty otherwise."""
        return self.stage.no_camera

    def __enter__(self) -> "Footage":
        return self

    def __exit__(self, *_: object) -> None:
        self.stage.close()


def open_run(path: Path, *, view: str | None = "follow", trust: bool = False) -> Footage:
    """What lies at ``path``: the folder of a run or an episode, a run of a comparison, or a log of
    any known format.

    view   of the 3D camera, None for none
    Raises as ``scripts.comparison.again.again``, which has ``trust``, too.
    """
    recipe = path / RECIPE
    if not (is_run(path) or recipe.exists()):
        check_vouched(recipe)  # one that is listed is lost: not what a log is
        return of_log(path)
    found = again(path, trust)
    try:
        if found.twin:
            return _of_twin(found, view)
        return replace(of_scene(found.told(), view=view), slam=found.slam)
    except (TypeError, ValueError, UnknownNameError) as error:
        raise LogFormatError(path, f"no recipe of a run: {error}") from error


def _of_twin(found: Again, view: str | None) -> Footage:
    """An episode that is one of three twins."""
    twins = Twins(**found.settings, labels=True, seconds=found.seconds)
    footage = of_simulation(
        twins.simulation,
        lambda: twins.moments(found.twin),
        seconds=found.seconds,
        title=title_of({**found.settings, "twin": found.twin}),
        view=None,  # the room of a twin is another one than its drive's
    )
    if view is not None:
        footage.stage.no_camera = (
            "this episode is one of three twins, whose rooms only the plan shows"
        )
    return footage


def of_scene(settings: Mapping[str, Any], *, view: str | None = "follow") -> Footage:
    """A simulated tour, or a part of it: scene, seconds, ``cut`` (fields of ``Cut``), and what
    ``Simulation`` takes."""
    seconds, cut = settings["seconds"], Cut(**settings.get("cut", {}))
    world = {k: v for k, v in settings.items() if k not in ("seconds", "cut")} | {"labels": True}
    simulation = Simulation(**world)
    return of_simulation(
        simulation, None if cut == WHOLE else lambda: cut.moments(simulation, world, seconds),
        seconds=seconds - cut.from_s, title=title_of(settings), view=view, cut=cut,
    )  # fmt: skip


def of_simulation(
    simulation: Simulation,
    moments: Callable[[], Iterator[Moment]] | None = None,
    *,
    seconds: float,
    title: str,
    view: str | None = "follow",
    cut: Cut = WHOLE,
) -> Footage:
    """A simulation at hand and the moments that it goes through, a tour unless said otherwise;
    ``cut``: what these leave out."""
    stage = Room(simulation, moments or (lambda: toured(simulation, seconds)), view)
    metadata = simulation.metadata()
    stream = Stream(
        metadata=replace(metadata, laser=Thin(cut.beams).spec(simulation.spec)),
        frames=stage.frames,
        length=-(-n_frames(seconds, simulation.scan_period_s) // cut.every) * len(simulation.specs),
    )
    made_with = {"odometry": simulation.odometry_preset, **metadata.extra}
    return Footage(
        stream=stream, stage=stage, title=title, duration_s=float(seconds),
        made_with={"simulation": made_with},
    )  # fmt: skip


def of_log(
    path: Path,
    *,
    strict: bool = False,
    text_format: Path | None = None,
    asked: Sequence[Asked] = (Asked(),),
    mounts: Sequence[Float] = (),
    flip: bool = False,
) -> Footage:
    """A log: its scans are all that is known of the world. Options as of ``open_log``.

    asked   topics of a bag, of each scanner
    mounts  (3,) T_robot_laser of each, in place of the log's; ``flip``: its beams count the other
            way round
    """
    check_bag(path)
    bag = text_format is None and is_bag(path)
    if not (bag or tuple(asked) == (Asked(),)):
        raise InvalidValueError(f"--scan and --odometry name topics, and {path} is no bag")
    if mounts and len(mounts) != len(asked):
        raise InvalidValueError("--laser is given once, or with several --scan once for each")
    if flip and len(asked) > 1:
        raise InvalidValueError("--flip is about one scanner, and --scan names several")
    streams = (
        [read_bag(path, labels=True, strict=strict, **vars(one)) for one in asked]
        if bag
        else [open_log(path, strict=strict, text_format=text_format)]
    )
    if mounts or flip:
        by = " and ".join(word for word, on in (("--laser", mounts), ("--flip", flip)) if on)
        streams = [
            remounted(stream, mounts[k] if mounts else None, flip=flip, by=by)
            for k, stream in enumerate(streams)
        ]
    stream = together(streams)
    labelled, stamps_ns, empty, usual_m = False, list[int](), 0, list[float]()
    tested = defaultdict[tuple[float, ...], MountingTest](MountingTest)
    for frame in stream:
        if frame.scan is not None:
            tested[frame.scan.spec.mount].note(frame)
            empty += float(frame.scan.valid.mean()) < FEW_RETURNS
            ranges = frame.scan.ranges[np.isfinite(frame.scan.ranges)]
            if len(ranges):
                usual_m.append(float(np.median(ranges)))
        stamps_ns.append(frame.stamp_ns)
        labelled = labelled or frame.labels is not None
    if not stamps_ns:
        raise InvalidValueError(f"{path}: holds no frame to film")
    return Footage(
        stream=stream,
        stage=Stage(labelled=labelled),
        title=path.resolve().name,
        duration_s=(stamps_ns[-1] - stamps_ns[0]) / NS_PER_S,
        truth_name=stream.metadata.truth or "truth",
        scans=len(stamps_ns),
        empty=empty / len(stamps_ns),
        usual_m=float(np.median(usual_m)) if usual_m else 0.0,
        tested=tested,
    )


def title_of(settings: Mapping[str, Any]) -> str:
    """``office · dynamism 0.5 · seed 4``; motion, change and crowd where they are given."""
    twin = f" · {settings['twin']} twin" if settings.get("twin") else ""
    knobs = [f"{k} {settings[k]}" for k in KNOBS if settings.get(k) is not None]
    if from_s := settings.get("cut", {}).get("from_s"):
        twin += f" · from {from_s:g} s"
    dynamism, seed = settings.get("dynamism", 0.5), settings.get("seed", 0)
    scene = settings["scene"]
    scene = Path(scene).name if is_file(scene) else scene
    return " · ".join([scene, f"dynamism {dynamism}", *knobs, f"seed {seed}{twin}"])
