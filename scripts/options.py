# SPDX-License-Identifier: Apache-2.0
"""Options that several verbs have, and what their words mean: each is declared and read here once.

Groups of them are dataclasses, for ``scripts.spec.part``. With them: of which axis of
``sim.core.dynamism`` the levels of ``compare`` and ``drive`` are.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from scenes import is_file
from scripts.console import note
from scripts.spec import SCANNERS, SLAMS, option, part, spec
from slam.errors import InvalidValueError, meant
from slam.names import NameFromFile, is_code, refuse_code
from slam.set_numbers import with_set
from slam.variants import COMMANDS, ORACLE, oracle_named

PEOPLE = "people"  # the axis of how many walk with the robot
AXES = ("dynamism", "motion", "change", PEOPLE)
MOST_PEOPLE, PEOPLE_MOTION = 80, 0.5  # and the motion at which they do, where none is held
MAX_SWEEP = 1000
LMS221_HZ = 37.5  # the rate for which the usual numbers of scans are chosen
BETWEEN = re.compile(r",(?![^{]*\}|[^(]*\))")  # a comma outside braces and brackets

# Options: a field is ``seconds: float = SECONDS(60.0)``.
SECONDS = partial(option, "Length of the simulated tour, s.")
SEED = partial(option, "Seed of the simulated run, whole number >= 0.")
SCANNER = partial(
    option,
    "Which scanner, and which of its errors: utm30lx, tim561:noise, "
    "'scanner(fov_deg=270, beams=541, rate_hz=20, sigma_m=0.01)'; full, noise (statistical "
    "only) and ideal are the LMS-221's.",
    "full",
    complete=SCANNERS,
)
ALSO_AT = partial(
    option,
    "Another scanner of that model at x,y,yaw_deg on the robot (m, m, deg); or several, each with "
    "the option again.",
)
CROWD = partial(
    option,
    "Who is there besides: none, or like escorts:6,boards:2; default the scene's own at "
    "this motion (mobilia config crowds).",
)
STRICT = partial(
    option,
    "Refuse a log that would have to be repaired, or whose scans contradict the place of "
    "its scanner; exit status 6 where more than a third of the scans are not trusted.",
    False,
)
ORACLES = partial(
    option,
    "Also this SLAM without the returns from what can move, by the true labels; "
    "SLAM,moving: from what moves now; map: scan matching to the true map. Repeatable.",
    metavar="SLAM[,moving]|map",
    complete=SLAMS,
)
SET = partial(
    option,
    "Change a number of a SLAM: --set matching.reward=7. With several SLAMs its name "
    "comes first: --set ekf.PATH=VALUE. mobilia config SLAM lists all. Repeatable.",
    None,
    "--set",
    metavar="[SLAM.]PATH=VALUE",
)
OVERWRITE = partial(option, "Replace an earlier run in that folder.", False)
PLAN = partial(
    option, "Only say what would run, and about how long it would take.", False, "--plan"
)
TRUST = partial(
    option, "Run the code that RUN's files name: module:Class, module:function, pipe:.", False
)
FILM = partial(option, "Write film.mp4.")


@spec
class Work:
    """Who does it, and whether it is done at all."""

    jobs: int = option("Processes of this machine.", 1)
    cluster: str | None = option("Or a Dask scheduler, tcp://host:port, that shares --out.")
    plan_only: bool = PLAN()


@spec
class Recorded:
    """How a log is to be read."""

    text_format: Path | None = option(
        "TOML file that says which columns of a text log hold what.", None, "--format"
    )
    scan: list[str] | None = option(
        "Topic of a bag's scans, /rear/scan; /scan:FRAME where several scanners share it. "
        "Repeated, several of one robot: SLAMs that take one get the first. Default the "
        "likeliest, which the first line names.",
        None,
        metavar="TOPIC",
    )
    odometry: str | None = option(
        "Topic of a bag's odometry, /wheel/odom; /tf:FRAME for the transforms below that frame.",
        metavar="TOPIC",
    )
    laser: list[str] | None = option(
        "Where a log's scanner is on the robot, m, m and degrees: --laser 0.1,0,180 looks "
        "backwards. Default as the log says. With several --scan, once for each.",
        None,
        metavar="X,Y,YAW_DEG",
    )
    flip: bool = option("A log's beams count the other way round (it hangs).", False)
    strict: bool = STRICT()


@spec
class Moves:
    """What moves in a room."""

    dynamism: float = option("How much the simulated room moves: 0 nothing, 1 most.", 0.5)
    motion: float | None = option("What moves now, 0 to 1; default as --dynamism says.")
    change: float | None = option(
        "Of what can move, the share that stands elsewhere when it is seen again, 0 to 1; "
        "default as --dynamism says.",
    )
    crowd: str | None = CROWD()

    def world(self, scene: str | None, seed: int) -> dict[str, Any]:
        """The settings of a room, as ``Simulation`` takes them; what is None is not among them."""
        check_held(self.motion, self.change, self.crowd)
        given = {"motion": self.motion, "change": self.change, "crowd": self.crowd}
        if scene is not None and is_file(scene):
            from scenes.scene_file import sha256_of

            given["scene_sha256"] = sha256_of(scene)
        told = {name: value for name, value in given.items() if value is not None}
        return {"scene": scene, "dynamism": self.dynamism, **told, "seed": seed}


@spec
class Staged:
    """What happens in a room at stated times, and to which robot."""

    events: Path | None = option(
        "TOML file of what happens when: pushes, doors, people who enter, the robot carried."
    )
    robot: str | None = option(
        "Another robot than the scene's: f1tenth, hunter2, pioneer3dx, rosbot_xl, "
        "turtlebot3, or a TOML file.",
    )

    def settings(self) -> dict[str, Any]:
        """The events of the file and the tables of the robot, as ``Simulation`` takes them."""
        from sim.world.robots import read_robot
        from sim.world.script import read_events

        given = {} if self.events is None else {"events": read_events(self.events)}
        return given if self.robot is None else {**given, "robot": read_robot(self.robot)}


@spec
class Tour:
    """A tour of a simulated scene."""

    seconds: float = SECONDS(60.0)
    moves: Moves = part(Moves)
    staged: Staged = part(Staged)
    seed: int = SEED(0)
    scan_height: float = option("Height of the simulated scanner above the floor, m.", 0.36)
    scanner: str = SCANNER()
    also_at: list[str] | None = ALSO_AT()

    def settings(self, scene: str) -> dict[str, Any]:
        """All of it and the scene, for a recipe and for ``Simulation``."""
        return {
            **self.moves.world(scene, self.seed), "seconds": self.seconds,
            "scan_height_m": self.scan_height, "laser": self.scanner, **self.staged.settings(),
            **also_at(self.also_at),
        }  # fmt: skip


def place_of(text: str, name: str) -> tuple[float, float, float]:
    """``-0.3,0,180`` as x m, y m, yaw deg; ``name`` of the option."""
    try:
        x, y, yaw_deg = (float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise InvalidValueError(
            f"{name} must be x,y,yaw_deg in m, m, deg, got {text!r}{_scanner_meant(text)}"
        ) from None
    return x, y, yaw_deg


def _scanner_meant(text: str) -> str:
    """Of a word where a place is wanted: a scanner is asked for by another option."""
    if not text[:1].isalpha():
        return ""
    from sim.sensors.lidar.registry import names

    return f"; --scanner says which scanner.{meant(text, names())} Known: {', '.join(names())}"


def also_at(texts: list[str] | None) -> dict[str, Any]:
    """Of ``ALSO_AT``, as ``Simulation`` and ``Recipe`` take it; nothing where it is not given."""
    names = ("x_m", "y_m", "yaw_deg")
    places = [place_of(text, "--also-at") for text in texts or ()]
    rows = [dict(zip(names, place, strict=True)) for place in places]
    return {"also_at": rows} if rows else {}


@spec
class Levels:
    """Levels of one axis, and what is held in all of them."""

    dynamism: list[str] | None = option(
        "Levels, as start:stop:step or one by one.", fills=("Plan.levels",)
    )
    motion: list[str] | None = option("Levels of motion alone, or one to hold.")
    change: list[str] | None = option("Levels of change alone, or one to hold.")
    people: list[str] | None = option("Levels of how many people walk with the robot, as 0:16:4.")
    crowd: str | None = CROWD()

    def of_plan(self) -> dict[str, Any]:
        """``axis``, ``levels`` and what is held, as the plans of studies take them.

        The axis is the one with several levels, else people, dynamism, motion or change, the first
        given; default 0 to 1 dynamism.
        """
        given = {name: levels(getattr(self, name) or [], f"--{name}") for name in AXES}
        several = [name for name, values in given.items() if len(values) > 1]
        if len(several) > 1:
            words = " and --".join(several)
            raise InvalidValueError(f"several levels of one axis only, got --{words}")
        if given[PEOPLE] and several not in ([], [PEOPLE]):
            raise InvalidValueError(
                f"--people are levels, and cannot be held beside --{several[0]}"
            )
        axis = (several or [name for name in (PEOPLE, *AXES) if given[name]] or ["dynamism"])[0]
        if axis != "dynamism" and given["dynamism"]:
            raise InvalidValueError(
                f"--dynamism sets both axes: with levels of --{axis} give the other axis instead"
            )
        held = {name: given[name][0] for name in ("motion", "change") if given[name]}
        held = {name: level for name, level in held.items() if name != axis}
        at = given[axis] or levels(["0:1:0.25"], "--dynamism")
        return {"axis": axis, "levels": at, **held, "crowd": self.crowd}


def exactly_one(words: str, *given: object) -> None:
    """``InvalidValueError`` unless one of those that ``words`` name is given."""
    if sum(one is not None for one in given) != 1:
        raise InvalidValueError(f"name exactly one of {words}")


def check_held(motion: float | None, change: float | None, crowd: str | None) -> None:
    """``InvalidValueError`` for what cannot hold in a room; None is as dynamism says."""
    for name, value in (("motion", motion), ("change", change)):
        if value is not None and not 0.0 <= value <= 1.0:
            raise InvalidValueError(f"--{name} must lie in [0, 1], got {value}")
    if crowd is not None:
        from scenes.crowd import crowd_of

        crowd_of(crowd)


def options_with(crowd: str | None) -> dict[str, Any]:
    """A crowd among the options of a scene."""
    return {} if crowd is None else {"crowd": crowd}


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What the levels of a comparison or a drive are of, and what is held.

    name    one of ``AXES``; with "motion" the other, change, is at 0 unless held, and so round;
            with ``PEOPLE`` the levels are numbers of people, and nobody else is there
    motion, change, crowd  the same at every level; None: as dynamism says
    """

    name: str = "dynamism"
    motion: float | None = None
    change: float | None = None
    crowd: str | None = None

    def __post_init__(self) -> None:
        check_held(self.motion, self.change, self.crowd)
        if self.name not in AXES:
            raise InvalidValueError(f"axis must be one of {', '.join(AXES)}, got {self.name!r:.80}")
        if getattr(self, self.name, None) is not None:
            raise InvalidValueError(f"--{self.name} cannot be held: the levels are of it")
        if self.name == PEOPLE and self.crowd is not None:
            raise InvalidValueError("--crowd cannot be held: the levels are of people")

    def at(self, level: float) -> dict[str, Any]:
        """``dynamism``, ``motion`` and ``change`` at a level, as ``Simulation`` takes them."""
        room = {"dynamism": 0.0, "motion": self.motion, "change": self.change}
        if self.name != PEOPLE:
            return {**room, self.name: level}
        return room if self.motion is not None else {**room, "motion": PEOPLE_MOTION}

    def crowd_at(self, level: float) -> str | None:
        """Who is there at a level, as ``crowd``; ``InvalidValueError`` for half a person."""
        if self.name != PEOPLE:
            return self.crowd
        if level not in range(MOST_PEOPLE + 1):
            raise InvalidValueError(
                f"--people must be whole numbers in 0..{MOST_PEOPLE}, got {level:g}"
            )
        return f"escorts:{level:g}"


def levels(values: list[str], option: str) -> tuple[float, ...]:
    """``["0:1:0.5"]`` or ``["0", "0.5,1"]`` -> (0, 0.5, 1)."""
    found: list[float] = []
    for word in named(values):
        kind = "start:stop:step" if ":" in word else "numbers or start:stop:step"
        try:
            numbers = [float(number) for number in word.split(":")]
        except ValueError:
            numbers = []
        if len(numbers) not in (1, 3):
            raise InvalidValueError(f"{option} must be {kind}, got {word!r}")
        found += numbers if len(numbers) == 1 else _sweep(word, numbers, option)
    return tuple(found)


def _sweep(text: str, numbers: list[float], option: str) -> list[float]:
    """Start, stop and step -> levels, both ends among them."""
    start, stop, step = numbers
    most = MOST_PEOPLE if option == f"--{PEOPLE}" else 1.0
    if not (step > 0.0 and 0.0 <= start <= stop <= most):
        raise InvalidValueError(
            f"{option} needs step > 0 and 0 <= start <= stop <= {most:g}, got {text!r}"
        )
    count = int((stop - start) / step + 1e-9) + 1
    if count > MAX_SWEEP:
        raise InvalidValueError(f"{option} {text!r}: {count} levels, at most {MAX_SWEEP}")
    return [round(start + k * step, 9) for k in range(count)]


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
