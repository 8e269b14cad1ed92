# SPDX-License-Identifier: Apache-2.0
"""``mobilia generate``: a dataset of episodes in rooms that move."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenes import registry
from scripts import options
from scripts.console import console
from scripts.names import check
from slam.errors import InvalidValueError

if TYPE_CHECKING:
    from rich.table import Table

    from sim.recording.dataset import Plan


def generate(
    scene: Annotated[
        list[str],
        typer.Argument(
            help="A scene by name, or module:function; or several, with the same seeds.",
            metavar="SCENE...",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder of the dataset.")],
    dynamism: Annotated[
        list[str] | None,
        typer.Option(
            help="How much the room moves, 0 to 1, default 0.5; or several, each with the same "
            "seeds: 0 0.5 1 or start:stop:step."
        ),
    ] = None,
    dynamism_sweep: Annotated[str, typer.Option(help="The same.", hidden=True)] = "",
    motion: options.Motion = None,
    change: options.Change = None,
    crowd: options.CrowdOption = None,
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
    jobs: options.Jobs = 1,
    cluster: options.Cluster = None,
    scanner: options.Scanner = "full",
    events: options.EventsOption = None,
    robot: options.RobotOption = None,
    plan_only: options.PlanOnly = False,
) -> None:
    """Write episodes as ROS 2 bags with truth, and the recipes that make them again.

    If it is killed, the same command continues: finished episodes stay, and the folder ends with
    the same bytes.

    [bold]mobilia generate office --dynamism 0.5 --episodes 4 --seconds 20 --out data[/bold]

    [bold]mobilia generate office arena --split train:8,validation:1,test:1 --out data[/bold]
    """
    levels = options.levels([dynamism_sweep] if dynamism_sweep else dynamism or ["0.5"])
    rooms = options.named(scene)
    check([], *rooms)
    from scripts import pace, workers
    from scripts.dataset import carry_out
    from sim.recording.dataset import Plan
    from sim.recording.recipe import Recipe
    from sim.recording.splits import split_of

    if split and episodes is not None:
        raise InvalidValueError("--split says how many episodes there are: leave --episodes out")
    parts = split_of(split)
    options.Held(motion=motion, change=change, crowd=crowd)  # complains by the options' names
    first = Recipe(
        scene=rooms[0], seed=seed, dynamism=levels[0], motion=motion, change=change,
        seconds=seconds, scanner=scanner, options=options.options_with(crowd),
        **options.staged(events, robot),
    )  # fmt: skip
    plan = Plan(
        recipe=first, dynamisms=levels, twins=twins, sessions=sessions, split=parts,
        episodes=sum(dict(parts).values()) or (1 if episodes is None else episodes),
        scenes=rooms if len(rooms) > 1 else (),
    )  # fmt: skip
    workers.check_jobs(jobs)
    for name in rooms:  # a wrong name is told, and a module found, before anything starts
        registry.find(name)
    there = set(os.listdir(out)) if out.is_dir() else set()
    missing = [job for job in plan.jobs() if not there.issuperset(plan.folders(job))]
    works = [pace.Work(f"generate {job.scene}", job.seconds) for job in missing]
    pace.announce(f"{len(missing)} of {len(plan.jobs())} drives to record", works, jobs)
    if plan_only:
        return
    table = carry_out(plan, out, jobs=jobs, cluster=cluster)
    console.print(table)
    table.title = None  # what was made now is not of the dataset
    _page(plan, out, table)


def _page(plan: "Plan", out: Path, table: "Table") -> None:
    """What was made, a plan of the first episode at its start, and what it is good for."""
    from scripts.pages.page import Page, Part, command, inline, publish
    from sim.simulation import Simulation
    from sim.view.mapview import MapView

    names, first = list(plan.planned()), plan.jobs()[0]
    room = Simulation(**first.simulation())
    room.sense()
    start = inline(MapView(room.world.scene, 1080, 720).draw(room.world.mover_poses(), room.frame))
    about = {key: value for key, value in first.words().items() if value not in (None, {})}
    page = Page(
        title=f"Episodes of {', '.join(plan.scenes or (first.scene,))}",
        said=[
            f"{len(names)} episodes of {first.seconds:g} s: bags of ROS 2 with odometry, scans and "
            "the truth of every beam."
        ],
        parts=[
            Part(title="The first one at its start", picture=start),
            Part(title="Episode by episode", table=table),
        ],
        next={
            "In this folder: is every byte still there?": command("verify", "."),
            "A SLAM on the first of them:": command("run", "shunting", "--log", names[0]),
            "The first of them as a film:": command("render", names[0]),
        },
        settings=about,
    )
    publish(out, page)
