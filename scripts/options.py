# SPDX-License-Identifier: Apache-2.0
"""Options that several verbs have, and what their words mean: each is declared and read here once.

With them: of which axis of ``sim.core.dynamism`` the levels of ``compare`` and ``drive`` are.
"""

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from scenes import is_file
from scripts.console import note
from slam.errors import InvalidValueError
from slam.names import NameFromFile, is_code, refuse_code
from slam.set_numbers import with_set
from slam.variants import COMMANDS, ORACLE, oracle_named

PEOPLE = "people"  # the axis of how many walk with the robot
AXES = ("dynamism", "motion", "change", PEOPLE)
MOST_PEOPLE, PEOPLE_MOTION = 80, 0.5  # and the motion at which they do, where none is held
MAX_SWEEP = 1000
LMS221_HZ = 37.5  # the rate for which the usual numbers of scans are chosen
BETWEEN = re.compile(r",(?![^{]*\}|[^(]*\))")  # a comma outside braces and brackets

Seconds = Annotated[float, typer.Option(help="Length of the simulated tour, s.")]
DynamismLevel = Annotated[
    float, typer.Option(help="How much the simulated room moves: 0 nothing, 1 most.")
]
Motion = Annotated[
    float | None,
    typer.Option(help="What moves now, 0 to 1; default as --dynamism says."),
]
Change = Annotated[
    float | None,
    typer.Option(
        help="Of what can move, the share that stands elsewhere when it is seen again, 0 to 1; "
        "default as --dynamism says."
    ),
]
CrowdOption = Annotated[
    str | None,
    typer.Option(
        "--crowd",
        help="Who is there besides: none, or like escorts:6,boards:2; default the scene's own at "
        "this motion (mobilia config crowds).",
    ),
]
EventsOption = Annotated[
    Path | None,
    typer.Option(
        "--events",
        help="TOML file of what happens when: pushes, doors, people who enter, the robot carried.",
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        "--robot",
        help="Another robot than the scene's: f1tenth, hunter2, pioneer3dx, rosbot_xl, "
        "turtlebot3, or a TOML file.",
    ),
]
MotionLevels = Annotated[
    list[str] | None, typer.Option("--motion", help="Levels of motion alone, or one to hold.")
]
ChangeLevels = Annotated[
    list[str] | None, typer.Option("--change", help="Levels of change alone, or one to hold.")
]
PeopleLevels = Annotated[
    list[str] | None,
    typer.Option("--people", help="Levels of how many people walk with the robot, as 0:16:4."),
]
Seed = Annotated[int, typer.Option(help="Seed of the simulated run, whole number >= 0.")]
ScanHeight = Annotated[
    float, typer.Option(help="Height of the simulated scanner above the floor, m.")
]
Scanner = Annotated[
    str,
    typer.Option(
        help="Which scanner, and which of its errors: utm30lx, tim561:noise, "
        "'scanner(fov_deg=270, beams=541, rate_hz=20, sigma_m=0.01)'; full, noise (statistical "
        "only) and ideal are the LMS-221's."
    ),
]
TextFormat = Annotated[
    Path | None,
    typer.Option("--format", help="TOML file that says which columns of a text log hold what."),
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Refuse a log that would have to be repaired, or whose scans contradict the place of "
        "its scanner; exit status 6 where more than a third of the scans are not trusted.",
    ),
]
Laser = Annotated[
    str | None,
    typer.Option(
        "--laser",
        help="Where a log's scanner is on the robot, m, m and degrees: --laser 0.1,0,180 looks "
        "backwards. Default as the log says.",
        metavar="X,Y,YAW_DEG",
    ),
]
Flip = Annotated[
    bool, typer.Option("--flip", help="A log's beams count the other way round (it hangs).")
]
Oracles = Annotated[
    list[str] | None,
    typer.Option(
        "--oracle",
        help="Also this SLAM without the returns from what can move, by the true labels; "
        "SLAM,moving: from what moves now; map: scan matching to the true map. Repeatable.",
        metavar="SLAM[,moving]|map",
    ),
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Change a number of a SLAM: --set matching.reward=7. With several SLAMs its name "
        "comes first: --set ekf.PATH=VALUE. mobilia config SLAM lists all. Repeatable.",
        metavar="[SLAM.]PATH=VALUE",
    ),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Replace an earlier run in that folder.")
]
PlanOnly = Annotated[
    bool,
    typer.Option("--plan", help="Only say what would run, and about how long it would take."),
]
Jobs = Annotated[int, typer.Option(help="Processes of this machine.")]
Cluster = Annotated[
    str | None, typer.Option(help="Or a Dask scheduler, tcp://host:port, that shares --out.")
]
Trust = Annotated[
    bool,
    typer.Option(
        "--trust", help="Run the code that RUN's files name: module:Class, module:function, pipe:."
    ),
]


@dataclass(frozen=True, kw_only=True)
class Held:
    """What holds in every run: levels of axes in [0, 1] and the crowd; None: as dynamism says."""

    motion: float | None = None
    change: float | None = None
    crowd: str | None = None

    def __post_init__(self) -> None:
        for name in ("motion", "change"):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value <= 1.0:
                raise InvalidValueError(f"--{name} must lie in [0, 1], got {value}")
        if self.crowd is not None:
            from scenes.crowd import crowd_of

            crowd_of(self.crowd)

    def world(self, scene: str | None, dynamism: float, seed: int) -> dict[str, Any]:
        """The settings of a room, as ``Simulation`` takes them; what is None is not among them."""
        given = {name: value for name, value in asdict(self).items() if value is not None}
        if scene is not None and is_file(scene):
            from scenes.scene_file import sha256_of

            given["scene_sha256"] = sha256_of(scene)
        return {"scene": scene, "dynamism": dynamism, **given, "seed": seed}


def options_with(crowd: str | None) -> dict[str, Any]:
    """A crowd among the options of a scene."""
    return {} if crowd is None else {"crowd": crowd}


def staged(events: Path | None, robot: str | None) -> dict[str, Any]:
    """The events of a file and the tables of a robot, as ``Simulation`` takes them."""
    from sim.world.robots import read_robot
    from sim.world.script import read_events

    given = {} if events is None else {"events": read_events(events)}
    return given if robot is None else {**given, "robot": read_robot(robot)}


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What the levels of a comparison or a drive are of, and what is held.

    name  one of ``AXES``; with "motion" the other, change, is at 0 unless held, and so round;
          with ``PEOPLE`` the levels are numbers of people, and nobody else is there
    """

    name: str = "dynamism"
    held: Held = Held()

    def __post_init__(self) -> None:
        if self.name not in AXES:
            raise InvalidValueError(f"axis must be one of {', '.join(AXES)}, got {self.name!r:.80}")
        if getattr(self.held, self.name, None) is not None:
            raise InvalidValueError(f"--{self.name} cannot be held: the levels are of it")
        if self.name == PEOPLE and self.held.crowd is not None:
            raise InvalidValueError("--crowd cannot be held: the levels are of people")

    def at(self, level: float) -> dict[str, Any]:
        """``dynamism``, ``motion`` and ``change`` at a level, as ``Simulation`` takes them."""
        held = {"motion": self.held.motion, "change": self.held.change}
        if self.name == "dynamism":
            return {"dynamism": level, **held}
        if self.name == PEOPLE:
            motion = PEOPLE_MOTION if self.held.motion is None else self.held.motion
            return {"dynamism": 0.0, **held, "motion": motion}
        return {"dynamism": 0.0, **held, self.name: level}

    def crowd(self, level: float) -> str | None:
        """Who is there at a level, as ``Held.crowd``; ``InvalidValueError`` for half a person."""
        if self.name != PEOPLE:
            return self.held.crowd
        if level not in range(MOST_PEOPLE + 1):
            raise InvalidValueError(
                f"--people must be whole numbers in 0..{MOST_PEOPLE}, got {level:g}"
            )
        return f"escorts:{level:g}"


def sweep(text: str, option: str = "--dynamism-sweep", most: float = 1.0) -> tuple[float, ...]:
    """``0:1:0.25`` -> (0, 0.25, 0.5, 0.75, 1); ``InvalidValueError`` for anything else."""
    try:
        start, stop, step = (float(word) for word in text.split(":"))
    except ValueError:
        raise InvalidValueError(f"{option} must be start:stop:step, got {text!r}") from None
    if not (step > 0.0 and 0.0 <= start <= stop <= most):
        raise InvalidValueError(
            f"{option} needs step > 0 and 0 <= start <= stop <= {most:g}, got {text!r}"
        )
    count = int((stop - start) / step + 1e-9) + 1
    if count > MAX_SWEEP:
        raise InvalidValueError(f"{option} {text!r}: {count} levels, at most {MAX_SWEEP}")
    return tuple(round(start + k * step, 9) for k in range(count))


def axis_levels(
    dynamism: list[str] | None,
    motion: list[str] | None,
    change: list[str] | None,
    people: list[str] | None = None,
) -> tuple[str, tuple[float, ...], dict[str, Any]]:
    """The axis, its levels and what is held, from the options; default 0 to 1 dynamism.

    The axis is the one with several levels, else people, dynamism, motion or change, the first
    given.
    """
    words = dict(zip(AXES, (dynamism, motion, change, people), strict=True))
    given = {name: levels(values or [], f"--{name}") for name, values in words.items()}
    several = [name for name, values in given.items() if len(values) > 1]
    if len(several) > 1:
        raise InvalidValueError(f"several levels of one axis only, got --{' and --'.join(several)}")
    if given[PEOPLE] and several not in ([], [PEOPLE]):
        raise InvalidValueError(f"--people are levels, and cannot be held beside --{several[0]}")
    name = (several or [axis for axis in (PEOPLE, *AXES) if given[axis]] or ["dynamism"])[0]
    if name != "dynamism" and given["dynamism"]:
        raise InvalidValueError(
            f"--dynamism sets both axes: with levels of --{name} give the other axis instead"
        )
    held = {axis: given[axis][0] for axis in ("motion", "change") if axis != name and given[axis]}
    return name, given[name] or levels(["0:1:0.25"]), held


def levels(values: list[str], option: str = "--dynamism") -> tuple[float, ...]:
    """``["0:1:0.5"]`` or ``["0", "0.5,1"]`` -> (0, 0.5, 1)."""
    found: list[float] = []
    for word in named(values):
        if ":" in word:
            found += sweep(word, option, MOST_PEOPLE if option == f"--{PEOPLE}" else 1.0)
            continue
        try:
            found.append(float(word))
        except ValueError:
            raise InvalidValueError(
                f"{option} must be numbers or start:stop:step, got {word!r}"
            ) from None
    return tuple(found)


def rate_hz(scanner: str) -> float:
    """Scans per second; the errors of ``scanner_of`` for a name that is not known."""
    from sim.sensors.lidar.registry import scanner_of  # numpy, and every model

    return 1.0 / float(scanner_of(scanner).scanner().period_s)


def every_of(scanner: str, every: int | None, of_lms221: int) -> int:
    """One scan in so many: as asked, else as often in time as one in ``of_lms221`` of the LMS."""
    return every if every is not None else max(1, round(of_lms221 * rate_hz(scanner) / LMS221_HZ))


def with_oracles(
    slams: Sequence[str], oracles: Sequence[str] | None, set_: Sequence[str] | None
) -> tuple[str, ...]:
    """Names of the SLAMs and of the oracles, each with the numbers of ``--set`` that are for it.

    Raises ``InvalidValueError`` for what is no oracle, and as ``slam.set_numbers.with_set``.
    """
    return with_set([*slams, *map(oracle_named, oracles or ())], set_ or [])


def admitted(name: str, what: str, trust: bool) -> str:
    """``name`` as it may be resolved; with ``trust`` one line says what is about to run.

    what  "SLAM" or "scene"
    Raises ``UntrustedNameError`` for a name of code that a file holds, without ``trust``.
    """
    if not (isinstance(name, NameFromFile) and is_code(name)):
        return name
    if not trust:
        refuse_code(name, what)
    note(f"--trust: running the {what} {str(name)!r}, which {name.file} names")
    return name.trusted()


def whole(name: str, value: Any, least: int, most: int | None = None) -> None:
    """``InvalidValueError`` unless ``value`` is a whole number from ``least`` to ``most``."""
    bad = isinstance(value, bool) or not isinstance(value, int) or value < least
    if bad or (most is not None and value > most):
        wanted = f"a whole number >= {least}" if most is None else f"{least} to {most}"
        raise InvalidValueError(f"{name} must be {wanted}, got {value!r}")


def named(values: list[str]) -> tuple[str, ...]:
    """Words may also be joined by commas, but for a command, which may hold some, and inside
    the braces of a variant and the brackets of an oracle."""
    whole = (*COMMANDS, *(ORACLE + prefix for prefix in COMMANDS))
    parts = ([value] if value.startswith(whole) else BETWEEN.split(value) for value in values)
    return tuple(word for words in parts for word in words if word)
