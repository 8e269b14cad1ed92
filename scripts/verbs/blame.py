# SPDX-License-Identifier: Apache-2.0
"""``mobilia blame``: a counterfactual debugger."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.progress import Progress

from scripts import interrupt
from scripts.console import console, note, progress
from scripts.debugger.question import Question
from scripts.knobs import Change, CrowdOption, Held, Motion
from scripts.names import check, file_name, run_name
from scripts.scanner_option import Scanner
from scripts.trust import Trust
from scripts.verbs.compare import named
from slam.errors import InvalidValueError
from slam.evaluation.divergence import Rule
from slam.files import write_text

if TYPE_CHECKING:
    from scripts.debugger.counterfactual import Inquest
    from scripts.debugger.episode import Case
    from scripts.debugger.recording import Tape

AGREES_M = 1e-5  # a trajectory on file is rounded


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
    dynamism: Annotated[float, typer.Option(help="How much the scene moves, 0 to 1.")] = 0.5,
    motion: Motion = None,
    change: Change = None,
    crowd: CrowdOption = None,
    seed: Annotated[int, typer.Option(help="Of the simulated run, whole number >= 0.")] = 0,
    seconds: Annotated[float, typer.Option(help="Length of the simulated tour, s.")] = 60.0,
    scanner: Scanner = "full",
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
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier one in that folder.")
    ] = False,
    trust: Trust = False,
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
        horizon_s=horizon, top=top, repeats=repeats, who=named(who or []),
    )  # fmt: skip
    check([slam] if slam else [], scene)
    from scripts.debugger.episode import Case, case_of

    if run is not None:
        case, name = case_of(run, slam, every, trust), run_name(run)
    else:
        held = Held(motion=motion, change=change, crowd=crowd)
        world = {"scene": scene, "dynamism": dynamism, **held.given(), "seed": seed}
        settings, name = _world(world, option or [], scanner), f"{scene}-{seed}"
        case = Case(settings=settings, seconds=seconds, slam=slam or "shunting", every=every)
    if at is not None and not 0.0 <= at <= case.seconds:
        raise InvalidValueError(f"--at must lie in 0..{case.seconds:g} s, got {at:g}")
    folder = out or Path("out") / f"blame-{file_name(name)}-{file_name(case.slam)}"
    _tell(_carry_out(case, question, folder, overwrite), folder)


def _world(world: dict[str, Any], options: list[str], scanner: str) -> dict[str, Any]:
    """Settings of the simulation: scene, dynamism and seed, and what the options say."""
    from scripts.debugger.episode import options_of
    from sim.sensors.lidar.registry import scanner_of

    laser = scanner_of(scanner)
    settings = {**world, **options_of(options)}
    return settings if scanner == "full" else settings | {"laser": laser}


def _carry_out(case: Case, question: Question, folder: Path, overwrite: bool) -> Inquest:
    """Find who is to blame and write the folder."""
    from scripts.debugger.picture import blame_picture
    from scripts.debugger.words import as_json
    from scripts.output import whole_folder, write_recipe

    recipe = _recipe(case, question)
    with whole_folder(folder, overwrite=overwrite, command="blame", settings=recipe) as part:
        found = _inquest(case, question)
        blame_picture(part / "blame.png", found)
        text = json.dumps(as_json(found), indent=1, allow_nan=False)
        write_text(part / "blame.json", text + "\n")
        write_recipe(part, "blame", recipe)
    return found


def _inquest(case: Case, question: Question) -> Inquest:
    from scripts.debugger.counterfactual import hold
    from scripts.debugger.recording import record

    with progress() as bar:
        tape = record(case, _Bar(bar, "driving").scans)
        _compare(tape)
        return hold(tape, question, _Bar(bar, "re-runs").trials)


class _Bar:
    """One line of the progress."""

    def __init__(self, bar: Progress, words: str) -> None:
        self._bar = bar
        self._task = bar.add_task(words, total=None, unit="")

    def scans(self, done: int, of: int) -> None:
        """Scans of the original."""
        interrupt.check()
        if done % 25 == 0 or done == of:
            self._bar.update(self._task, completed=done, total=of, unit=f"{done}/{of} scans")

    def trials(self, what: str, done: int, of: int) -> None:
        """A re-run begins."""
        interrupt.check()
        words = what if len(what) < 50 else "all movers"
        self._bar.update(self._task, completed=done, total=of, unit=escape(words))


def _compare(tape: Tape) -> None:
    """Say so where the run on file was another one."""
    import numpy as np

    case = tape.case
    if case.made is not None and case.made.elsewhere():
        note(f"the episode was made elsewhere: {case.made.elsewhere()}")
    recorded, again = case.recorded, np.array(tape.strip.believed)
    if recorded is None:
        return
    if recorded.shape != again.shape:
        note(f"of {case.slam} {len(recorded)} poses are on file, the run again has {len(again)}")
        return
    gap = float(np.abs(recorded[:, :2] - again[:, :2]).max())
    if gap > AGREES_M:
        note(f"run again, {case.slam} is up to {gap:.3g} m elsewhere: other versions or CPU?")


def _recipe(case: Case, question: Question) -> dict[str, Any]:
    """What makes it again."""
    settings = {k: repr(v) if k == "laser" else v for k, v in case.settings.items()}
    asked = {f"asked_{k}": v for k, v in vars(replace(question)).items() if k != "rule"}
    rule = {f"rule_{k}": v for k, v in vars(question.rule).items()}
    own = {"slam": case.slam, "seconds": case.seconds, "every": case.every}
    return {**own, "simulation": settings, **asked, **rule}


def _tell(found: Inquest, folder: Path) -> None:
    from scripts.debugger.words import FIXED, headline, table

    says = headline(found)
    if found.trials:
        console.print(table(found))
    else:
        console.print(escape(says[0]), style="bold")
    console.print(escape(says[1]), highlight=False, soft_wrap=True)
    if found.trials:
        console.print(
            f"Held fixed: {FIXED}. The robot's path differs by at most {_path_m(found):.3f} m; "
            "'others' is how far other movers ended from where they did.",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
    console.print(f"Open [bold]{escape(str(folder / 'blame.png'))}[/bold].", soft_wrap=True)


def _path_m(found: Inquest) -> float:
    return max((trial.path_m for trial in found.trials if not trial.failed), default=0.0)
