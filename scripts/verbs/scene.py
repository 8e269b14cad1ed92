# SPDX-License-Identifier: Apache-2.0
"""``mobilia scene``: make a scene of a map or a log, show it, check it."""

from pathlib import Path
from typing import Annotated

import typer

from scripts.console import fact, note, say, working
from scripts.names import check as check_names
from scripts.names import file_name, run_name
from scripts.option_names import Verb
from scripts.options import Overwrite, Seed, Strict
from slam.errors import InvalidValueError, MobiliaError

scene = typer.Typer(help="Make a scene of a map or a log, show it, check it.", no_args_is_help=True)

Furniture = Annotated[
    str, typer.Option(help="Small things of the map: move (they can be pushed), keep, drop.")
]
Doors = Annotated[
    str, typer.Option(help="Doors in gaps of 0.7 to 1.2 m: none, open, ajar, closed, mixed.")
]
Tolerance = Annotated[
    float, typer.Option(help="m by which a straightened wall may miss the middle of its cells.")
]
Out = Annotated[Path | None, typer.Option(help="STEM of STEM.toml, .xml and .png.")]
Start = Annotated[
    str | None, typer.Option(help="Where the robot starts in the map: x,y or x,y,degrees.")
]
Which = Annotated[str, typer.Argument(help="A scene by name, module:function, or its file.")]


@scene.command("from-map", cls=Verb)
def from_map(
    map_yaml: Annotated[
        Path, typer.Argument(help="A map_server YAML file, its PGM or PNG beside it.")
    ],
    out: Out = None,
    furniture: Furniture = "move",
    doors: Doors = "none",
    start: Start = None,
    tolerance: Tolerance = 0.05,
    overwrite: Overwrite = False,
) -> None:
    """Make a scene of a map: a plan in MJCF, a recipe in TOML, a picture.

    [bold]mobilia scene from-map map.yaml[/bold]
    """
    _check_choices(furniture, doors)
    from scenes.from_map import FromMap
    from scripts.scene import make

    options = FromMap(tolerance_m=tolerance, start=_start(start))
    with working(f"reading {map_yaml.name}"):
        raster = make.of_file(map_yaml)
    with working("finding walls and rooms"):
        done = make.made(
            raster, options, out or Path(map_yaml.stem), source=map_yaml.name,
            furniture=furniture, doors=doors, overwrite=overwrite,
        )  # fmt: skip
    _tell(done)


@scene.command("from-log", cls=Verb)
def from_log(
    log: Annotated[Path, typer.Argument(help="A log, as for mobilia run --log.")],
    out: Out = None,
    slam: Annotated[str, typer.Option(help="The SLAM that makes the map.")] = "shunting",
    furniture: Furniture = "move",
    doors: Doors = "none",
    tolerance: Tolerance = 0.05,
    strict: Strict = False,
    overwrite: Overwrite = False,
) -> None:
    """Make a scene of the map that a SLAM makes of a log; the robot starts where the log did.

    [bold]mobilia scene from-log intel.log[/bold]
    """
    _check_choices(furniture, doors)
    check_names([slam])
    from scenes.from_map import FromMap
    from scripts.scene import make

    with working(f"{slam} maps {log.name}"):
        raster, poses = make.of_log(log, slam, strict=strict)
    first = (float(poses[0, 0]), float(poses[0, 1]), float(poses[0, 2]))
    options = FromMap(tolerance_m=tolerance, start=first, path=poses[:, :2])
    with working("finding walls and rooms"):
        done = make.made(
            raster, options, out or Path(run_name(log)), source=log.name,
            furniture=furniture, doors=doors, overwrite=overwrite,
        )  # fmt: skip
    _tell(done)


@scene.command("show", cls=Verb)
def show(which: Which, out: Out = None, seed: Seed = 0, width: int = 1600) -> None:
    """Draw a scene from above, and list what stands and what moves.

    [bold]mobilia scene show lab.toml[/bold]
    """
    check_names([], which)
    import imageio.v2 as imageio

    import scenes
    from scripts.scene.make import contents
    from sim.view.mapview import MapView
    from slam.files import replacing

    built = scenes.build(which, seed)
    a, b, c, d = built.bounds
    height = max(200, min(4096, round(width * (d - b + 1.0) / (c - a + 0.6))))
    path = (out or Path(f"{file_name(Path(which).stem)}-seen")).with_suffix(".png")
    picture = MapView(built, width, height).draw([built.initial[m.name] for m in built.movers])
    with replacing(path) as new:
        imageio.imwrite(new, picture, format="png")
    for line in contents(built):
        say(line, highlight=False)
    note(f"wrote {path}")


@scene.command("check", cls=Verb)
def check(which: Which, seed: Seed = 0) -> None:
    """Say what is wrong with a scene, by file and mark; one scan of it is simulated.

    [bold]mobilia scene check lab.toml[/bold]
    """
    check_names([], which)
    import scenes
    from scripts.scene.make import problems
    from sim.simulation import Simulation

    Simulation(which, seed=seed).observe()  # raises what ``run`` would
    found = list(problems(scenes.build(which, seed)))
    for problem in found:
        fact(f"{which}: {problem}", bad=True)
    if found:
        raise MobiliaError(f"{which}: {len(found)} things are wrong")
    note(f"{which}: nothing is wrong")


@scene.command("kinds", cls=Verb)
def kinds(
    out: Annotated[Path | None, typer.Option(help="Also draw them all here, a PNG.")] = None,
) -> None:
    """List the kinds of furniture that a scene's file may put.

    [bold]mobilia scene kinds --out kinds.png[/bold]
    """
    from scripts.scene.make import kinds as known
    from scripts.scene.make import picture

    stands, moves = known()
    say(f"stands: {', '.join(stands)}", highlight=False)
    say(f"can be pushed: {', '.join(moves)}", highlight=False)
    if out is not None:
        import imageio.v2 as imageio

        from slam.files import replacing

        path = out.with_suffix(".png")
        with replacing(path) as new:
            imageio.imwrite(new, picture(), format="png")
        note(f"wrote {path}")


def _tell(done: object) -> None:
    from scripts.scene import make

    assert isinstance(done, make.Made)
    for line in make.in_words(done.plan):
        say(line, highlight=False)
    toml, xml, picture = done.files
    note(f"wrote {toml} (the scene's name), {xml} (walls and rooms) and {picture}")


def _check_choices(furniture: str, doors: str) -> None:
    for name, value, known in (
        ("--furniture", furniture, ("move", "keep", "drop")),
        ("--doors", doors, ("none", "open", "ajar", "closed", "mixed")),
    ):
        if value not in known:
            raise InvalidValueError(f"{name} must be one of {', '.join(known)}, got {value!r:.80}")


def _start(words: str | None) -> tuple[float, float, float] | None:
    if words is None:
        return None
    try:
        numbers = [float(word) for word in words.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or not all(abs(n) < 1e5 for n in numbers):
        raise InvalidValueError(f"--start must be x,y or x,y,degrees, got {words!r:.80}")
    import math

    return numbers[0], numbers[1], math.radians(numbers[2]) if len(numbers) == 3 else 0.0
