# SPDX-License-Identifier: Apache-2.0
"""``mobilia scene``: make a scene of a map or a log, show it, check it."""

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from scripts import options
from scripts.console import fact, note, say, working
from scripts.names import check as check_names
from scripts.names import file_name, run_name
from scripts.option_names import Verb, Verbs
from scripts.spec import REQUIRED, SLAMS, argument, command, option, part, spec
from slam.errors import InvalidValueError, MobiliaError

if TYPE_CHECKING:
    from scenes.from_map import FromMap
    from slam.estimate import Raster

scene = typer.Typer(
    cls=Verbs, help="Make a scene of a map or a log, show it, check it.", no_args_is_help=True
)

OUT = partial(option, "STEM of STEM.toml, .xml and .png.", writes=True)
WHICH = partial(argument, "A scene by name, module:function, or its file.", REQUIRED)
TOLERANCE = partial(option, "m by which a straightened wall may miss the middle of its cells.")
ROBOT = partial(
    option,
    "The robot that drives there: a name or TOML file as of run, or a radius in m (a "
    "pioneer3dx of that size).",
    fills=("FromMap.robot_m",),
)


@spec
class Parts:
    """What is made of the small things of a map, and of its gaps."""

    furniture: str = option(
        "Small things of the map: move (they can be pushed), keep, drop.", "move",
        choices=("move", "keep", "drop"),
    )  # fmt: skip
    doors: str = option(
        "Doors in gaps of 0.7 to 1.2 m: none, open, ajar, closed, mixed.", "none",
        choices=("none", "open", "ajar", "closed", "mixed"),
    )  # fmt: skip

    def make(self, map_: "Raster", how: "FromMap", stem: Path, **more: Any) -> None:
        """The scene's files; say what is in them."""
        from scripts.scene import make

        with working("finding walls and rooms"):
            done = make.made(map_, how, stem, furniture=self.furniture, doors=self.doors, **more)
        for line in (*make.in_words(done.plan), *make.contents(done.seen.scene)):
            say(line, highlight=False)
        toml, xml, picture = done.files
        note(f"wrote {toml} (the scene's name), {xml} (walls and rooms) and {picture}")
        for problem in done.problems():
            fact(f"{toml}: {problem}", bad=True)


@spec
class OfMap:
    """Make a scene of a map: a plan in MJCF, a recipe in TOML, a picture.

    [bold]mobilia scene from-map map.yaml[/bold]
    """

    map_yaml: Path = argument("A map_server YAML file, its image beside it.", REQUIRED)
    out: Path | None = OUT()
    parts: Parts = part(Parts)
    robot: str | None = ROBOT()
    start: str | None = option("Where the robot starts in the map: x,y or x,y,degrees.")
    tolerance: float = TOLERANCE(0.05)
    overwrite: bool = options.OVERWRITE()

    def __call__(self) -> None:
        from scenes.from_map import FromMap
        from scripts.scene.make import of_file
        from scripts.scene.robot import robot_of

        robot_m, robot = robot_of(self.robot)
        start = _start(self.start)
        how = FromMap(tolerance_m=self.tolerance, start=start, robot_m=robot_m)
        with working(f"reading {self.map_yaml.name}"):
            raster = of_file(self.map_yaml)
        self.parts.make(
            raster, how, self.out or Path(self.map_yaml.stem), source=self.map_yaml.name,
            robot=robot, overwrite=self.overwrite,
        )  # fmt: skip


@spec
class OfLog:
    """Make a scene of the map that a SLAM makes of a log; the robot starts where the log did.

    [bold]mobilia scene from-log intel.log[/bold]
    """

    log: Path = argument("A log, as for mobilia run --log.", REQUIRED)
    out: Path | None = OUT()
    slam: str = option("The SLAM that makes the map.", "shunting", complete=SLAMS)
    parts: Parts = part(Parts)
    robot: str | None = ROBOT()
    tolerance: float = TOLERANCE(0.05)
    strict: bool = options.STRICT()
    overwrite: bool = options.OVERWRITE()

    def __call__(self) -> None:
        check_names([self.slam])
        from scenes.from_map import FromMap
        from scripts.scene.make import of_log
        from scripts.scene.robot import robot_of

        robot_m, robot = robot_of(self.robot)
        with working(f"{self.slam} maps {self.log.name}"):
            raster, poses = of_log(self.log, self.slam, strict=self.strict)
        x, y, heading = poses[0].tolist()
        start, path = (x, y, heading), poses[:, :2]
        how = FromMap(tolerance_m=self.tolerance, start=start, path=path, robot_m=robot_m)
        self.parts.make(
            raster, how, self.out or Path(run_name(self.log)), source=self.log.name,
            robot=robot, overwrite=self.overwrite,
        )  # fmt: skip


@spec
class Show:
    """Draw a scene from above, and list what stands and what moves.

    [bold]mobilia scene show lab.toml[/bold]
    """

    which: str = WHICH()
    out: Path | None = OUT()
    seed: int = options.SEED(0)

    def __call__(self) -> None:
        check_names([], self.which)
        from scripts.scene.make import Seen, contents

        path = (self.out or Path(f"{file_name(Path(self.which).stem)}-seen")).with_suffix(".png")
        seen = Seen(self.which, self.seed)
        for line in contents(seen.scene):
            say(line, highlight=False)
        note(f"wrote {seen.picture(path)}")


@spec
class Check:
    """Say what is wrong with a scene, by file and mark; one scan of it is simulated.

    [bold]mobilia scene check lab.toml[/bold]
    """

    which: str = WHICH()
    seed: int = options.SEED(0)

    def __call__(self) -> None:
        check_names([], self.which)
        from scripts.scene.make import Seen

        found = Seen(self.which, self.seed).problems()
        for problem in found:
            fact(f"{self.which}: {problem}", bad=True)
        if found:
            raise MobiliaError(f"{self.which}: problems found: {len(found)}")
        note(f"{self.which}: nothing is wrong")


@spec
class Kinds:
    """List the kinds of furniture that a scene's file may put.

    [bold]mobilia scene kinds --out kinds.png[/bold]
    """

    out: Path | None = option("Also draw them all here, a PNG.", writes=True)

    def __call__(self) -> None:
        from scripts.scene import picture

        stands, moves = picture.kinds()
        say(f"stands: {', '.join(stands)}", highlight=False)
        say(f"can be pushed: {', '.join(moves)}", highlight=False)
        if self.out is not None:
            import imageio.v2 as imageio

            from slam.files import replacing

            with replacing(path := self.out.with_suffix(".png")) as new:
                imageio.imwrite(new, picture.kinds_picture(), format="png")
            note(f"wrote {path}")


SPECS = {"from-map": OfMap, "from-log": OfLog, "show": Show, "check": Check, "kinds": Kinds}
for _name, _spec in SPECS.items():
    scene.command(_name, cls=Verb)(command(_spec))


def _start(words: str | None) -> tuple[float, float, float] | None:
    if words is None:
        return None
    try:
        numbers = [float(word) for word in words.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(abs(n) < 1e5 for n in numbers):
        raise InvalidValueError(f"--start must be x,y or x,y,degrees, got {words!r:.80}")
    return numbers[0], numbers[1], math.radians(numbers[2]) if len(numbers) == 3 else 0.0
