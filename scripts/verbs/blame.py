# SPDX-License-Identifier: Apache-2.0
"""``mobilia blame``: a counterfactual debugger."""

from pathlib import Path
from typing import TYPE_CHECKING

from scripts import options
from scripts.console import console, say
from scripts.debugger.question import Question
from scripts.names import check, file_name, run_name
from scripts.spec import SCENES, SLAMS, argument, command_line, option, part, spec
from slam.errors import InvalidValueError
from slam.evaluation.lost import Rule
from slam.names import is_code

if TYPE_CHECKING:
    from scripts.debugger.counterfactual import Inquest
    from scripts.debugger.recording import Case


WORLD = ("scene", "seed", "dynamism", "motion", "change", "crowd")  # options of ``run``, too


@spec
class Blame:
    """Find which mover misled a SLAM, by running the world again without it.

    The first divergence of the run is found, world and SLAM are put back to some seconds before,
    and run on from there with one mover (and what it holds) or one group of a crowd taken out or
    frozen at a time. Writes blame.png, blame.json
    and the recipe.

    [bold]mobilia blame out/run-office[/bold]

    [bold]mobilia blame --scene arena --option walls=none --dynamism 1 --slam ekf[/bold]
    """

    folder: Path | None = argument(
        "Folder of a simulated run, an episode, or DIR/runs/NAME.npz of a comparison.",
        metavar="[RUN]",
    )
    slam: str | None = option(
        "SLAM to examine; default the run's first, or shunting.", complete=SLAMS
    )
    scene: str | None = option("Instead of RUN: a scene to simulate.", complete=SCENES)
    moves: options.Moves = part(options.Moves)
    seed: int = options.SEED(0)
    seconds: float = options.SECONDS(60.0)
    scanner: str = options.SCANNER()
    scene_option: list[str] | None = option(
        "Option of the scene: NAME=VALUE, e.g. n_chairs=6.", None, "--option"
    )
    every: int = option("The SLAM gets one scan in so many.", 1)
    threshold: float = option("Rise of the error that counts as a divergence, m.", Rule.threshold_m)
    within: float = option("Time within which it rises, s.", Rule.within_s)
    at: float | None = option("Examine this time instead of searching, s.")
    lead: float = option("Time from the checkpoint to the divergence, s.", Question.lead_s)
    horizon: float = option(
        "Time from the divergence to the end of the re-runs, s.", Question.horizon_s
    )
    top: int = option("Try only this many of the likeliest; 0: all observed.", Question.top)
    who: list[str] | None = option(
        "Try only these: a mover, a group (escorts, chairs) or a pattern (group[0-3])."
    )
    repeats: int = option("Repeats of original and cure with other noise.", Question.repeats)
    out: Path | None = option("Folder; default out/blame-...", writes=True)
    overwrite: bool = options.OVERWRITE()
    trust: bool = options.TRUST()

    def __call__(self) -> None:
        options.exactly_one("RUN and --scene", self.folder, self.scene)
        question = Question(
            rule=Rule(threshold_m=self.threshold, within_s=self.within), at_s=self.at,
            lead_s=self.lead, horizon_s=self.horizon, top=self.top, repeats=self.repeats,
            who=options.named(self.who or []),
        )  # fmt: skip
        check([self.slam], self.scene)
        from scripts.debugger.make import carry_out
        from scripts.debugger.recording import case_of

        if self.folder is not None:
            case = case_of(self.folder, self.slam, self.every, self.trust)
            name = run_name(self.folder)
        else:
            case, name = self._simulated(), f"{self.scene}-{self.seed}"
        if self.at is not None and not 0.0 <= self.at <= case.seconds:
            raise InvalidValueError(f"--at must lie in 0..{case.seconds:g} s, got {self.at:g}")
        out = self.out or Path("out") / f"blame-{file_name(name)}-{file_name(case.slam)}"
        _tell(carry_out(case, question, out, overwrite=self.overwrite), out, self.folder)

    def _simulated(self) -> "Case":
        """Of a scene: dynamism and seed, and what the options say."""
        from scripts.debugger.recording import Case, options_of
        from sim.sensors.lidar.registry import scanner_of

        scanner_of(self.scanner)  # complains
        settings = {
            **self.moves.world(self.scene, self.seed),
            **options_of(self.scene_option or []),
        }
        if self.scanner != "full":
            settings |= {"laser": self.scanner}
        slam = self.slam or "shunting"
        return Case(settings=settings, seconds=self.seconds, slam=slam, every=self.every)


def _tell(found: "Inquest", folder: Path, run: Path | None) -> None:
    from scripts.debugger.words import FIXED, headline, table
    from scripts.pages.page import Page, Part, publish

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
    film = _film(case, run)
    then = {"The whole run as a film:": film} if film else {}
    told = {"slam": case.slam, "seconds": case.seconds, "every": case.every, **case.settings}
    publish(folder, Page(
        title=f"What misled {case.slam}?", said=says, parts=parts, next=then, settings=told
    ))  # fmt: skip


def _film(case: "Case", run: Path | None) -> str:
    """What makes a film of the run; "" where options of the scene would be left out."""
    if run is not None:
        trust = is_code(case.settings["scene"])
        return command_line("render", folder=run, slam=case.slam, trust=trust)
    world = {name: case.settings.get(name) for name in WORLD}
    if {*case.settings} - {*world, "scene_sha256"}:
        return ""
    return command_line("run", slam=case.slam, seconds=case.seconds, **world)


def _path_m(found: "Inquest") -> float:
    return max((trial.path_m for trial in found.trials if not trial.failed), default=0.0)
