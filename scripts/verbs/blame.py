# SPDX-License-Identifier: Apache-2.0
"""``mobilia blame``: a counterfactual debugger."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scripts import options
from scripts.console import console, say
from scripts.debugger.question import Question
from scripts.names import check, file_name, run_name
from slam.errors import InvalidValueError
from slam.evaluation.lost import Rule

if TYPE_CHECKING:
    from scripts.debugger.counterfactual import Inquest


def blame(
    run: Annotated[
        Path | None,
        typer.Argument(
            help="Folder of a simulated run, an episode, or DIR/runs/NAME.npz of a comparison.",
            metavar="[RUN]",
        ),
    ] = None,
    slam: Annotated[
        str | None, typer.Option(help="SLAM to examine; default the run's first, or shunting.")
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Instead of RUN: a scene to simulate.")] = None,
    dynamism: options.DynamismLevel = 0.5,
    motion: options.Motion = None,
    change: options.Change = None,
    crowd: options.CrowdOption = None,
    seed: options.Seed = 0,
    seconds: options.Seconds = 60.0,
    scanner: options.Scanner = "full",
    option: Annotated[
        list[str] | None, typer.Option(help="Option of the scene: NAME=VALUE, e.g. n_chairs=6.")
    ] = None,
    every: Annotated[int, typer.Option(help="The SLAM gets one scan in so many.")] = 1,
    threshold: Annotated[
        float, typer.Option(help="Rise of the error that counts as a divergence, m.")
    ] = Rule.threshold_m,
    within: Annotated[float, typer.Option(help="Time within which it rises, s.")] = Rule.within_s,
    at: Annotated[
        float | None, typer.Option(help="Examine this time instead of searching, s.")
    ] = None,
    lead: Annotated[
        float, typer.Option(help="Time from the checkpoint to the divergence, s.")
    ] = Question.lead_s,
    horizon: Annotated[
        float, typer.Option(help="Time from the divergence to the end of the re-runs, s.")
    ] = Question.horizon_s,
    top: Annotated[
        int, typer.Option(help="Try only this many of the likeliest; 0: all observed.")
    ] = Question.top,
    who: Annotated[
        list[str] | None,
        typer.Option(
            help="Try only these: a mover, a group (escorts, chairs) or a pattern (group[0-3])."
        ),
    ] = None,
    repeats: Annotated[
        int, typer.Option(help="Repeats of original and cure with other noise.")
    ] = Question.repeats,
    out: Annotated[Path | None, typer.Option(help="Folder; default out/blame-...")] = None,
    overwrite: options.Overwrite = False,
    trust: options.Trust = False,
) -> None:
    """Find which mover misled a SLAM, by running the world again without it.

    The first divergence of the run is found, world and SLAM are put back to some seconds before,
    and run on from there with one mover (and what it holds) or one group of a crowd taken out or
    frozen at a time. Writes blame.png, blame.json
    and the recipe.

    [bold]mobilia blame out/run-office[/bold]

    [bold]mobilia blame --scene arena --option walls=none --dynamism 1 --slam ekf[/bold]
    """
    if (run is None) == (scene is None):
        raise InvalidValueError("name exactly one of RUN and --scene")
    question = Question(
        rule=Rule(threshold_m=threshold, within_s=within), at_s=at, lead_s=lead,
        horizon_s=horizon, top=top, repeats=repeats, who=options.named(who or []),
    )  # fmt: skip
    check([slam] if slam else [], scene)
    from scripts.debugger.make import carry_out
    from scripts.debugger.recording import Case, case_of

    if run is not None:
        case, name = case_of(run, slam, every, trust), run_name(run)
    else:
        held = options.Held(motion=motion, change=change, crowd=crowd)
        world = held.world(scene, dynamism, seed)
        settings, name = _world(world, option or [], scanner), f"{scene}-{seed}"
        case = Case(settings=settings, seconds=seconds, slam=slam or "shunting", every=every)
    if at is not None and not 0.0 <= at <= case.seconds:
        raise InvalidValueError(f"--at must lie in 0..{case.seconds:g} s, got {at:g}")
    folder = out or Path("out") / f"blame-{file_name(name)}-{file_name(case.slam)}"
    _tell(carry_out(case, question, folder, overwrite=overwrite), folder, run)


def _world(world: dict[str, Any], words: list[str], scanner: str) -> dict[str, Any]:
    """Settings of the simulation: scene, dynamism and seed, and what the options say."""
    from scripts.debugger.recording import options_of
    from sim.sensors.lidar.registry import scanner_of

    laser = scanner_of(scanner)
    settings = {**world, **options_of(words)}
    return settings if scanner == "full" else settings | {"laser": laser}


def _tell(found: "Inquest", folder: Path, run: Path | None) -> None:
    from scripts.debugger.words import FIXED, headline, table
    from scripts.pages.page import Page, Part, command, publish

    says = headline(found)
    shown = table(found) if found.trials else None
    fixed = (
        f"Held fixed: {FIXED}. The robot's path differs by at most {_path_m(found):.3f} m; "
        "'others' is how far other movers ended from where they did."
    )
    if shown is not None:
        console.print(shown)
        say(fixed, highlight=False)
    case = found.tape.case
    parts = [
        Part(title="What happened, and what would have", picture="blame.png"),
        *([] if shown is None else [Part(title="The world again", note=fixed, table=shown)]),
    ]
    then = {"The whole run as a film:": command("render", run)}
    if run is None:
        world = [f"--{name}={case.settings[name]}" for name in ("scene", "dynamism", "seed")]
        then = {"The whole run as a film:": command("run", case.slam, *world)}
    told = {"slam": case.slam, "seconds": case.seconds, "every": case.every, **case.settings}
    publish(folder, Page(
        title=f"What misled {case.slam}?", said=says, parts=parts, next=then, settings=told
    ))  # fmt: skip


def _path_m(found: "Inquest") -> float:
    return max((trial.path_m for trial in found.trials if not trial.failed), default=0.0)
