# SPDX-License-Identifier: Apache-2.0
"""``mobilia generate``: a dataset of episodes in rooms that move."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from scenes import registry
from scripts import options
from scripts.console import console
from scripts.formats import BAG, FORMATS, ready
from scripts.names import check
from scripts.spec import REQUIRED, SCENES, argument, command_line, names_of, option, part, spec
from sim.recording import MINARI
from slam.errors import InvalidValueError
from slam.names import is_code

if TYPE_CHECKING:
    from rich.table import Table

    from sim.recording.dataset import Plan


@spec
class Generate:
    """Write episodes as ROS 2 bags with truth, and the recipes that make them again.

    If it is killed, the same command continues: finished episodes stay, and the folder ends with
    the same bytes.

    [bold]mobilia generate office --dynamism 0.5 --episodes 4 --seconds 20 --out data[/bold]

    [bold]mobilia generate office arena --split train:8,validation:1,test:1 --out data[/bold]
    """

    scene: list[str] = argument(
        "A scene by name, or module:function; or several, with the same seeds.", REQUIRED,
        metavar="SCENE...", complete=SCENES, fills=("Plan.scenes",),
    )  # fmt: skip
    out: Path = option("Folder of the dataset.", REQUIRED, writes=True)
    dynamism: list[str] | None = option(
        "How much the room moves, 0 to 1, default 0.5; or several, each with the same "
        "seeds: 0 0.5 1 or start:stop:step.",
        fills=("Plan.dynamisms",),
    )
    moves: options.Moves = part(options.Moves, without=("dynamism",))
    episodes: int | None = option("Episodes (in each scene, at each dynamism); default 1.")
    split: str = option(
        "Parts by name and number of episodes instead, no seed in two of them: "
        "train:8,validation:1,test:1. Each gets a list of its episodes, OUT/train.txt.",
        "",
        metavar="NAME:N,...",
    )
    format: str = option(
        "Also write each episode so, beside its bag: db3, parquet, npz, carmen or tum (as export "
        "does). minari: no bags, but episodes with actions and rewards, driven to goals.",
        BAG,
        choices=tuple(FORMATS),
        metavar="FORMAT",
        complete=names_of("scripts.formats:FORMATS"),
    )
    seconds: float = option("Length of an episode, s.", 60.0)
    seed: int = option("Seed of the first episode; each next one adds 1.", 0)
    twins: bool = option("Each episode also semi-static and static, with one path.", False)
    sessions: int = option("So many sessions of one building instead, --change apart.", 0)
    work: options.Work = part(options.Work, without=("plan_only",))
    scanner: str = options.SCANNER()
    also_at: list[str] | None = options.ALSO_AT()
    staged: options.Staged = part(options.Staged)
    plan_only: bool = options.PLAN()

    def plan(self) -> "Plan":
        """The episodes of the dataset; ``InvalidValueError`` for what cannot be."""
        levels = options.levels(self.dynamism or ["0.5"], "--dynamism")
        rooms = options.named(self.scene)
        check([], *rooms)
        ready(self.format, recorded=False)
        from scripts import workers
        from sim.recording.dataset import Plan
        from sim.recording.recipe import Recipe
        from sim.recording.splits import split_of

        if self.split and self.episodes is not None:
            raise InvalidValueError(
                "--split says how many episodes there are: leave --episodes out"
            )
        parts, moves = split_of(self.split), self.moves
        options.check_held(moves.motion, moves.change, moves.crowd)
        first = Recipe(
            scene=rooms[0], seed=self.seed, dynamism=levels[0], motion=moves.motion,
            change=moves.change, seconds=self.seconds, scanner=self.scanner,
            options=options.options_with(moves.crowd), **self.staged.settings(),
            **options.also_at(self.also_at),
        )  # fmt: skip
        usual = 1 if self.episodes is None else self.episodes
        plan = Plan(
            recipe=first, dynamisms=levels, twins=self.twins, sessions=self.sessions, split=parts,
            episodes=sum(dict(parts).values()) or usual, scenes=rooms if len(rooms) > 1 else (),
            format="" if self.format == BAG else self.format,
        )  # fmt: skip
        if self.format == MINARI:
            _check_environment(plan)
        workers.check_jobs(self.work.jobs)
        for name in rooms:  # a wrong name is told, and a module found, before anything starts
            registry.find(name)
        return plan

    def __call__(self) -> None:
        plan, out = self.plan(), self.out
        from scripts import pace
        from scripts.dataset import carry_out, rooms_of
        from sim.recording.dataset import refuse_others

        refuse_others(out, plan)
        there = set(os.listdir(out)) if out.is_dir() else set()
        missing = [job for job in plan.jobs() if not there.issuperset(plan.folders(job))]
        kind = "generate"
        if self.format == MINARI:
            kind, rooms = MINARI, rooms_of(plan)
            missing = [job for name in rooms.keys() - there for job in rooms[name]]
        works = [pace.Work(f"{kind} {job.scene}", job.seconds) for job in missing]
        pace.announce(
            f"{len(missing)} of {len(plan.jobs())} drives to record", works, self.work.jobs
        )
        if self.plan_only:
            return
        table = carry_out(plan, out, jobs=self.work.jobs, cluster=self.work.cluster)
        console.print(table)
        if self.format == MINARI:
            return
        table.title = None  # what was made now is not of the dataset
        _page(plan, out, table)


def _check_environment(plan: "Plan") -> None:
    """``InvalidValueError`` for what an environment cannot have."""
    from sim.gym.offline import spec_of

    if plan.twins or plan.sessions:
        raise InvalidValueError("--format minari is of single drives: no --twins and no --sessions")
    spec_of(plan.recipe)


def _page(plan: "Plan", out: Path, table: "Table") -> None:
    """What was made, a plan of the first episode at its start, and what it is good for."""
    from scripts.pages.page import Page, Part, inline, publish
    from sim.simulation import Simulation
    from sim.view.mapview import MapView

    names, first = list(plan.planned()), plan.jobs()[0]
    room = Simulation(**first.simulation())
    room.sense()
    start = inline(MapView(room.world.scene, 1080, 720).draw(room.world.mover_poses(), room.frame))
    about = {key: value for key, value in first.words().items() if value not in (None, {})}
    here = Path("FOLDER")  # a dataset has the same bytes wherever it lies
    one = here / names[0]
    page = Page(
        title=f"Episodes of {', '.join(plan.scenes or (first.scene,))}",
        said=[
            f"{len(names)} episodes of {first.seconds:g} s: bags of ROS 2 with odometry, scans and "
            "the truth of every beam."
        ],
        parts=[
            Part(title="The first one at its start", picture=start),
            Part(title="What they hold", table=table),
        ],
        next={
            "Is every byte still there? FOLDER is that of this page:": command_line(
                "verify", folder=here
            ),
            "A SLAM on the first of them:": command_line("run", slam="shunting", log=one),
            "The first of them as a film:": command_line(
                "render", folder=one, trust=is_code(first.scene)
            ),
        },
        settings=about,
    )
    publish(out, page)
