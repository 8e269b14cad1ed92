# SPDX-License-Identifier: Apache-2.0
"""``mobilia generate``: a dataset of episodes in rooms that move."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.markup import escape
from rich.progress import Progress
from rich.table import Table

from scenes import registry
from scripts import interrupt
from scripts.console import console, note, progress
from scripts.knobs import Change, CrowdOption, Held, Motion, options_with
from scripts.names import check
from scripts.process_options import Cluster, Jobs
from scripts.scanner_option import Scanner, rate_hz
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from sim.recording.dataset import Dataset
    from sim.recording.recipe import Recipe

MAX_SWEEP = 1000


def generate(
    scene: Annotated[
        list[str],
        typer.Argument(
            help="A scene by name, or module:function; or several, with the same seeds.",
            metavar="SCENE...",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder of the dataset.")],
    dynamism: Annotated[float, typer.Option(help="How much the room moves, 0 to 1.")] = 0.5,
    dynamism_sweep: Annotated[
        str, typer.Option(help="Several instead, each with the same seeds: start:stop:step.")
    ] = "",
    motion: Motion = None,
    change: Change = None,
    crowd: CrowdOption = None,
    episodes: Annotated[
        int | None, typer.Option(help="Episodes (in each scene, at each dynamism); default 1.")
    ] = None,
    split: Annotated[
        str,
        typer.Option(
            help="Parts by name and number of episodes instead, no seed in two of them: "
            "train:8,validation:1,test:1. Each gets a list of its episodes, OUT/train.txt.",
            metavar="NAME:N,...",
        ),
    ] = "",
    seconds: Annotated[float, typer.Option(help="Length of an episode, s.")] = 60.0,
    seed: Annotated[int, typer.Option(help="Seed of the first episode; each next one adds 1.")] = 0,
    twins: Annotated[
        bool,
        typer.Option("--twins", help="Each episode also semi-static and static, with one path."),
    ] = False,
    sessions: Annotated[
        int, typer.Option(help="So many sessions of one building instead, --change apart.")
    ] = 0,
    jobs: Jobs = 1,
    cluster: Cluster = None,
    scanner: Scanner = "full",
) -> None:
    """Write episodes as ROS 2 bags with truth, and the recipes that make them again.

    If it is killed, the same command continues: finished episodes stay, and the folder ends with
    the same bytes.

    [bold]mobilia generate office --dynamism 0.5 --episodes 4 --seconds 20 --out data[/bold]

    [bold]mobilia generate office arena --split train:8,validation:1,test:1 --out data[/bold]
    """
    levels = sweep(dynamism_sweep) if dynamism_sweep else (dynamism,)
    check([], *scene)
    from scripts import workers
    from sim.recording.dataset import Plan, writing
    from sim.recording.recipe import Recipe
    from sim.recording.splits import split_of

    if split and episodes is not None:
        raise InvalidValueError("--split says how many episodes there are: leave --episodes out")
    parts = split_of(split)
    Held(motion=motion, change=change, crowd=crowd)  # complains by the options' names
    first = Recipe(
        scene=scene[0], seed=seed, dynamism=levels[0], motion=motion, change=change,
        seconds=seconds, scanner=scanner, options=options_with(crowd),
    )  # fmt: skip
    plan = Plan(
        recipe=first, dynamisms=levels, twins=twins, sessions=sessions, split=parts,
        episodes=sum(dict(parts).values()) or (1 if episodes is None else episodes),
        scenes=tuple(scene) if len(scene) > 1 else (),
    )  # fmt: skip
    workers.check_jobs(jobs)
    for name in scene:  # a wrong name is told, and a module found, before anything starts
        registry.find(name)
    with writing(out, plan) as dataset:
        missing, notes = dataset.missing()
        for line in notes:
            note(line)
        started = time.perf_counter()
        _make(dataset, missing, jobs, cluster)
        dataset.finish()
        spent = time.perf_counter() - started
    console.print(_summary(dataset, len(missing), spent))
    console.print(f"{escape(str(out))}: check it with [bold]mobilia verify[/bold]", soft_wrap=True)


def sweep(text: str, option: str = "--dynamism-sweep") -> tuple[float, ...]:
    """``0:1:0.25`` -> (0, 0.25, 0.5, 0.75, 1); ``InvalidValueError`` for anything else."""
    try:
        start, stop, step = (float(word) for word in text.split(":"))
    except ValueError:
        raise InvalidValueError(f"{option} must be start:stop:step, got {text!r}") from None
    if not (step > 0.0 and 0.0 <= start <= stop <= 1.0):
        raise InvalidValueError(
            f"{option} needs step > 0 and 0 <= start <= stop <= 1, got {text!r}"
        )
    count = int((stop - start) / step + 1e-9) + 1
    if count > MAX_SWEEP:
        raise InvalidValueError(f"{option} {text!r}: {count} levels, at most {MAX_SWEEP}")
    return tuple(round(start + k * step, 9) for k in range(count))


def _make(dataset: Dataset, missing: list[Recipe], jobs: int, cluster: str | None) -> None:
    """Every missing episode, with a bar: episodes, simulated seconds a second, time left."""
    from scripts import workers

    total, length_s = len(dataset.plan.jobs()), dataset.plan.recipe.seconds
    alone = cluster is None and (jobs == 1 or len(missing) < 2)
    with progress() as bar:
        meter = _Meter(
            bar,
            total=total,
            done=total - len(missing),
            length_s=length_s,
            rate_hz=rate_hz(dataset.plan.recipe.scanner),
        )
        note_frame = meter.frame if alone else None
        call = partial(_one, dataset.path, note_frame)
        for _ in workers.each(call, missing, jobs=jobs, cluster=cluster, shared=dataset.path):
            meter.episode()


def _one(folder: Path, note_frame: Callable[[], None] | None, recipe: Recipe) -> None:
    """A job, here or in a worker."""
    from sim.recording.episode import record

    record(recipe, folder, note=note_frame or (lambda: None))


class _Meter:
    """The progress bar; counts in simulated seconds."""

    def __init__(
        self, bar: Progress, *, total: int, done: int, length_s: float, rate_hz: float
    ) -> None:
        self._bar, self._total, self._done, self._length_s = bar, total, done, length_s
        self._frames, self._before, self._started = 0, done, time.perf_counter()
        self._rate_hz = rate_hz
        self._task = bar.add_task(
            "generating", unit="", total=total * length_s, completed=int(done * length_s)
        )

    def frame(self) -> None:
        """One more scan of the episode that is being made here."""
        self._frames += 1
        if self._frames % 25 == 0:
            self._show(min(self._frames / self._rate_hz, self._length_s))

    def episode(self) -> None:
        """One more episode."""
        self._done, self._frames = self._done + 1, 0
        self._show(0.0)

    def _show(self, begun_s: float) -> None:
        interrupt.check()
        seconds = (self._done - self._before) * self._length_s + begun_s
        rate = seconds / max(time.perf_counter() - self._started, 1e-3)
        unit = f"{self._done}/{self._total} episodes, {rate:.1f} s simulated per s"
        self._bar.update(self._task, completed=self._before * self._length_s + seconds, unit=unit)


def _summary(dataset: Dataset, made: int, spent_s: float) -> Table:
    """Episodes, frames, distance, what returns came from, bytes: a row a scene and dynamism."""
    plan = dataset.plan
    scenes = plan.scenes or (plan.recipe.scene,)
    table = Table(
        title=escape(f"{', '.join(scenes)}: {made} of {len(plan.jobs())} made now"),
        title_justify="left",
        caption=f"{spent_s:.1f} s",
        caption_justify="left",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),  # nine columns in 80 characters
        pad_edge=False,
    )
    returns = ("moving", "semi static", "static")
    table.add_column("scene", overflow="fold")
    for heading in ("dynamism", "episodes", "frames", "driven, m", *returns, "MB"):
        longest = max(map(len, heading.split()))
        table.add_column(heading, justify="right", min_width=longest)
    for scene, level in product(scenes, plan.dynamisms):
        jobs = [job for job in plan.jobs() if (job.scene, job.dynamism) == (scene, level)]
        folders = [dataset.path / name for job in jobs for name in plan.folders(job)]
        table.add_row(escape(scene), f"{level:g}", *_row(folders))
    return table


def _row(folders: list[Path]) -> list[str]:
    from sim.recording.recipe import RECIPE, read_recipe

    results: list[Any] = [read_recipe(folder / RECIPE).result for folder in folders]
    returns = {
        name: sum(int(result["returns"][name]) for result in results)
        for name in ("moving", "semi_static", "static")
    }
    beams = max(sum(returns.values()), 1)
    size = sum(file.stat().st_size for folder in folders for file in folder.iterdir())
    return [
        str(len(folders)),
        str(sum(int(result["frames"]) for result in results)),
        f"{sum(float(result['distance_m']) for result in results):.1f}",
        *(f"{100.0 * count / beams:.1f} %" for count in returns.values()),
        f"{size / 1e6:.1f}",
    ]
