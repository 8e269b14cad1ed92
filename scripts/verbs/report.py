# SPDX-License-Identifier: Apache-2.0
"""``mobilia report``: a comparison as one page."""

from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from scripts.console import fact, say, working
from scripts.spec import REQUIRED, SLAMS, argument, option, spec

if TYPE_CHECKING:
    from scripts.report.study import Study


@spec
class Report:
    """Write DIR/report.html: one page, self-contained, that opens from disk and prints.

    It begins with the answer, which is printed here too: from which level on the SLAM is lost.

    [bold]mobilia report out/compare --subject ekf[/bold]
    """

    folder: Path = argument("Folder that mobilia compare wrote.", REQUIRED, metavar="DIR")
    subject: str | None = option(
        "SLAM that the page is about; default the one named first.", complete=SLAMS
    )
    replays: bool = option("Also DIR/replays: the subject's worst run of each scene.", False)

    def __call__(self) -> None:
        from scripts.output import locked_folder
        from scripts.report import page
        from scripts.report.answer import failed
        from scripts.report.study import check_comparison, study

        check_comparison(self.folder)
        about = study(self.folder, self.subject)
        with locked_folder(self.folder, "compare"):
            with working("drawing the page"):
                path = page.write(about)
            for line in failed(about.compared.runs, about.axis):
                fact(line, bad=True)
            for line in page.answers(about):
                fact(line)
            for verb, what in (("blame", "What misled it"), ("shrink", "In how little of the run")):
                for line in page.for_worst(verb, about):
                    say(f"{what}: [bold]{escape(line)}[/bold]", highlight=False)
            if self.replays:
                with working("replaying the worst runs"):
                    made = _replays(about)
                say(f"Wrote [bold]{escape(', '.join(made))}[/bold].")
        say(f"Open [bold]{escape(str(path))}[/bold] ({path.stat().st_size / 1e6:.1f} MB).")


def _replays(about: "Study") -> list[str]:
    """Pages of the subject's worst run in each scene, made again from its recipe."""
    from scripts.comparison.plan import Run
    from scripts.film.footage import open_run
    from scripts.film.render import shoot
    from scripts.live.replay import Recorder

    made = []
    for scene in about.scenes:
        row = about.worst(scene, about.subject)[0]
        run = Run(scene=scene, dynamism=row["dynamism"], seed=int(row["seed"]), axis=about.axis)
        path = about.compared.folder / "runs" / f"{run.name}.npz"
        out = about.compared.folder / "replays" / f"{path.stem}.html"
        out.parent.mkdir(exist_ok=True)
        with open_run(path, view=None) as footage:
            show = footage.show([about.subject])
            with Recorder.of(out, show) as recorder:
                for _ in shoot(footage.stream, show, None):
                    recorder.note(show.shown)
        made.append(str(out))
    return made
