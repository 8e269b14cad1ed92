# SPDX-License-Identifier: Apache-2.0
"""``mobilia run``: SLAMs on a recorded log or a simulated tour, scored, mapped and filmed."""

from pathlib import Path
from typing import Any

from scripts import options
from scripts.names import check, run_name, scene_name
from scripts.options import Recorded
from scripts.spec import REQUIRED, SCENES, SLAMS, argument, option, part, spec
from slam.errors import InvalidValueError, MissingPathError
from slam.variants import MAP_ORACLE


@spec
class Run:
    """Run SLAMs on a log or on a simulated scene and write the same files as the demo.

    [bold]mobilia run shunting --log intel.log.xz[/bold]

    [bold]mobilia run shunting my_package.my_slam:MySlam --scene arena --dynamism 1[/bold]
    """

    slam: list[str] = argument(
        "SLAMs to run, by name (see [bold]mobilia list[/bold]) or as module:Class. "
        "Odometry always runs beside them.",
        REQUIRED,
        metavar="SLAM...",
        complete=SLAMS,
    )
    log: Path | None = option(
        "A log: a bag of ROS 1 or 2, CARMEN (.log, .clf), L/O in centimetres, an MRPT "
        ".rawlog, the folder of Victoria Park; or any text log with --format."
    )
    recorded: Recorded = part(Recorded)
    scene: str | None = option(
        "Or a simulated scene, driven on a tour of its rooms.", complete=SCENES
    )
    recipe: Path | None = option(
        "Or a simulated run on file, made again: the folder of run, demo or shrink, an episode, or "
        "DIR/runs/NAME.npz of a comparison."
    )
    tour: options.Tour = part(options.Tour)
    out: Path | None = option("Folder to write; default out/run-<log or scene>.", writes=True)
    overwrite: bool = options.OVERWRITE()
    film: bool = options.FILM(True)
    plan_only: bool = options.PLAN()
    map_in: Path | None = option(
        "Begin anywhere in this map of days before (docs/days.md); with --log."
    )
    map_out: Path | None = option("Keep the map, this session included; with --log.", writes="file")
    at: str | None = option(
        "When the session began, 2026-05-04T09:00; default the log's clock.",
        fills=("Session.time_s",),
    )
    oracle: list[str] | None = options.ORACLES()
    set_: list[str] | None = options.SET()
    trust: bool = options.TRUST()

    def __call__(self) -> None:
        options.exactly_one("--log, --scene and --recipe", self.log, self.scene, self.recipe)
        slams = list(options.with_oracles(options.named(self.slam), self.oracle, self.set_))
        if MAP_ORACLE in slams:
            raise InvalidValueError(
                "--oracle map is for compare and benchmark: they know the true map"
            )
        check(slams, self.scene)
        if self.recipe is not None:
            self._on_scene(slams, run_name(self.recipe), self._made_again(self.recipe))
        elif self.scene is not None:
            self._on_scene(slams, scene_name(self.scene), self.tour.settings(self.scene))
        elif self.log is not None:
            self._on_log(slams, self.log)

    def _made_again(self, recipe: Path) -> dict[str, Any]:
        """The tour of a run on file, as ``on_scene`` takes it."""
        from scripts.comparison.again import again

        if self.tour != options.Tour():
            raise InvalidValueError("--recipe says which tour it is: leave options of it out")
        if not recipe.exists():
            raise MissingPathError(recipe, "no such folder")
        return again(recipe, self.trust).told()

    def _on_scene(self, slams: list[str], name: str, settings: dict[str, Any]) -> None:
        for text in self.recorded.laser or ():
            options.place_of(text, "--laser")
        if self.recorded != Recorded():
            raise InvalidValueError(
                "--strict, --format, --scan, --odometry, --laser and --flip are about a --log"
            )
        if self.map_in or self.map_out or self.at:
            raise InvalidValueError("--map-in, --map-out and --at are about a --log")
        from scripts.single_run.run import on_scene
        from scripts.single_run.session import Outputs

        outputs = Outputs(
            folder=self.out or Path("out") / f"run-{name}", command="run",
            overwrite=self.overwrite, film=self.film,
        )  # fmt: skip
        on_scene(slams, settings, outputs, plan_only=self.plan_only)

    def _on_log(self, slams: list[str], log: Path) -> None:
        from scripts.jobs import try_names
        from scripts.output import refuse_others
        from scripts.pace import announce, timed
        from scripts.single_run.run import Log, Maps, on_log, on_log_work
        from slam.logs.open import format_of

        maps = Maps(map_in=self.map_in, map_out=self.map_out, at=self.at)
        folder = self.out or Path("out") / f"run-{run_name(log)}"
        recorded = Log(path=log, **vars(self.recorded))
        if not log.exists():
            raise MissingPathError(log, "no such file")
        format_of(log, recorded.text_format)
        try_names(slams, ())
        refuse_others(folder, "run")
        work = on_log_work(slams, log, self.film)
        filmed = ", filmed" * self.film
        announce(f"{log.name}, {work.amount / len(slams):.1f} MB{filmed}", [work])
        if not self.plan_only:
            with timed(work):
                on_log(slams, recorded, folder, overwrite=self.overwrite, film=self.film, maps=maps)
