# SPDX-License-Identifier: Apache-2.0
"""``mobilia twin``: a log driven again in simulation, in its own building."""

import json
from pathlib import Path

from rich.markup import escape

from scripts import options
from scripts.console import console, plain_table, say, working
from scripts.names import check, run_name
from scripts.spec import REQUIRED, SCENES, argument, command_line, option, spec
from slam.errors import InvalidValueError

SHOWN = ("beams", "median_m", "within_5_cm", "within_10_cm")


@spec
class Twin:
    """Make the twin of a log: its building, its way at its times, its scanner, such odometry.

    Writes twin.log, a recording for every verb that takes a log; building.toml, a scene;
    twin.json and differences.png, which lay the scans of both side by side.

    [bold]mobilia twin intel.log.xz --out out/intel[/bold]

    [bold]mobilia run shunting --log out/intel/twin.log[/bold]
    """

    log: Path = argument("A log of any format that run --log takes.", REQUIRED)
    out: Path | None = option("Folder; default out/twin-<log>.", writes=True)
    poses: str = option(
        "Where its scans were taken: the log's reference, or the final poses of a SLAM "
        "(default where it has no reference: shunting).",
        "reference",
    )
    scene: Path | None = option(
        "The building, a TOML or MJCF file; default made of the log.", complete=SCENES
    )
    crowd: str = option("Who is there besides: none, or like streams:6,groups:4.", "none")
    motion: float = option("How much they move, 0 to 1; with --crowd.", 0.0)
    seed: int = options.SEED(0)
    overwrite: bool = option("Replace the folder's.", False)

    def __call__(self) -> None:
        if self.poses != "reference":
            check([self.poses])
        if (self.crowd != "none") != (self.motion > 0.0) or not 0.0 <= self.motion <= 1.0:
            raise InvalidValueError(
                f"--crowd needs a --motion above 0 and up to 1, and the reverse: {self.crowd}, "
                f"{self.motion:g}"
            )
        log, scene = self.log, self.scene
        folder = self.out or Path("out") / f"twin-{run_name(log)}"
        building = [] if scene is not None else ["building.toml", "building.xml"]
        names = ("twin.log", "twin.json", "differences.png", *building)
        from scripts.log_twin import make
        from scripts.whole_folder import check_place
        from slam.files import write_text
        from slam.logs import write_carmen

        check_place(*(folder / name for name in names), overwrite=self.overwrite)
        folder.mkdir(parents=True, exist_ok=True)
        with working(f"reading {log.name}"):
            read = make.recorded(log, self.poses)
        with working("building and driving its twin"):
            if scene is None:
                read, scene = make.housed(read, folder)
            made = make.made(read, scene, seed=self.seed, crowd=self.crowd, motion=self.motion)
        write_carmen(folder / "twin.log", made.stream)
        words = json.dumps({"log": log.name, **made.words}, indent=1)
        write_text(folder / "twin.json", words + "\n")
        title = f"{run_name(log)}: the twin's returns beside the log's"
        make.differences(folder / "differences.png", made.beside, read.poses, title)
        table = plain_table(f"{log.name} and its twin", caption=f"poses: {read.whose}")
        for heading in ("beams on what", *SHOWN):
            table.add_column(heading.replace("_", " "), justify="right")
        for name, part in made.beside.words().items():
            table.add_row(name, *(f"{part.get(key, float('nan')):g}" for key in SHOWN))
        console.print(table)
        say(f"Look at [bold]{escape(str(folder / 'differences.png'))}[/bold]. A SLAM in the twin:")
        say(escape(command_line("run", slam="shunting", log=folder / "twin.log")), highlight=False)
