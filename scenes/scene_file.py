# SPDX-License-Identifier: Apache-2.0
"""What a TOML file of a scene says, checked before anything is built (docs/scenes.md)."""

import hashlib
import math
import os
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from scenes import is_file
from scenes.elements import Metres, Size
from scenes.kinds import KINDS, PUSHED
from scenes.plan import furniture
from scenes.plan_file import MAX_BYTES, MOST_BOXES
from scenes.recipe import Count
from scenes.scene import Pose
from slam.bounded import beside, bytes_of, toml_of
from slam.errors import InvalidValueError, MissingPathError
from slam.names import NameFromFile
from slam.shaped import Table, one_of, shaped

_Many = Meta(max_length=5000)  # walls, things, doors or pieces of furniture
Point = tuple[Metres, Metres]
At = tuple[Metres, Metres, Metres]  # m, m, degrees
Line = Annotated[tuple[Point, ...], Meta(min_length=2, max_length=5000)]


class Wanted(Table, frozen=True, kw_only=True):
    """The options of a scene in a file.

    furniture  "move": things can be pushed, "keep": they stand, "drop": they are not there
    doors      "none", or how they rest          seats  whether tables bring chairs' places
    """

    furniture: Literal["move", "keep", "drop"] = "move"
    doors: Literal["none", "open", "ajar", "closed", "mixed"] = "open"
    seats: bool = True
    n_chairs: Count = 0
    n_people: Count = 0


class Thing(Table, frozen=True):
    """What moves, and the boxes (x, y, length, width m, degrees) that it is when not."""

    kind: str
    at: At
    boxes: Annotated[
        tuple[tuple[Metres, Metres, Size, Size, Metres], ...], Meta(min_length=1, max_length=100)
    ]


class SceneFile(Wanted, frozen=True, kw_only=True):
    """One file; ``read`` makes it.

    plan     the MJCF file of walls and marks; "" where ``walls`` are drawn
    walls    polylines, (x, y) m each          wall_m  their thickness
    start    None: the first free place        rooms   xmin, ymin, xmax, ymax m; () for all floor
    put      kind and pose of furniture        hinges  poses of doors', and "left" or "right"
    path     of the file                       given   which options it says
    """

    plan: Annotated[str, Meta(pattern=r"^([^\0]*\.xml)?$")] = ""
    walls: Annotated[tuple[Line, ...], _Many] = ()
    wall_m: Annotated[float, Meta(ge=0.01, le=1e4)] = 0.1
    start: At | None = None
    rooms: Annotated[tuple[tuple[Metres, Metres, Metres, Metres], ...], _Many] = ()
    goals: Annotated[tuple[Point, ...], _Many] = ()
    put: Annotated[tuple[tuple[str, Metres, Metres, Metres], ...], _Many] = ()
    things: Annotated[tuple[Thing, ...], _Many] = ()
    hinges: Annotated[
        tuple[tuple[Metres, Metres, Metres, Literal["left", "right"]], ...], _Many
    ] = ()
    path: str = ""
    given: tuple[str, ...] = ()

    @property
    def plan_path(self) -> Path:
        """Of the MJCF file: this one, or one that lies beside it."""
        path = Path(self.path)
        return path if path.suffix == ".xml" else beside(path, self.plan)

    @property
    def pieces(self) -> list[tuple[str, Pose]]:
        """``put``, headings in rad."""
        return [(kind, pose_of(x, y, degrees)) for kind, x, y, degrees in self.put]


MORE = ("event", "robot")  # keys that others read (``sim``)
KEYS = (*(name for name in SceneFile.__struct_fields__ if name not in ("path", "given")), *MORE)


def pose_of(x: float, y: float, degrees: float) -> Pose:
    """A pose as files have it, in m and rad."""
    return x, y, math.radians(degrees)


def tables(path: Path) -> dict[str, Any]:
    """The keys of a TOML file; ``InvalidValueError`` and ``LogFormatError`` name what is wrong."""
    found = toml_of(path, MAX_BYTES)
    for key in found:
        if key not in KEYS:
            raise InvalidValueError(
                f"{path}: unknown key '{key:.80}', expected one of {', '.join(KEYS)}"
            )
    return found


def read(path: Path) -> SceneFile:
    """What a file says: TOML, or MJCF alone. ``InvalidValueError`` names the file and the key."""
    if path.suffix == ".xml":
        return SceneFile(path=str(path), plan=path.name)
    own = {key: value for key, value in tables(path).items() if key not in MORE}
    try:
        if ("walls" in own) == ("plan" in own):
            got = "both" if "plan" in own else "neither"
            raise InvalidValueError(f"plan or walls must be one of the two, got {got}")
        if "plan" in own and {"rooms", "goals", "start"} & set(own):
            raise InvalidValueError("rooms, goals and start must be marks of the plan beside plan")
        file: SceneFile = shaped("", own, SceneFile)
        _check(file)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: {error}") from None
    given = tuple(key for key in Wanted.__struct_fields__ if key in own)
    return msgspec.structs.replace(file, path=str(path), given=given)


def _check(file: SceneFile) -> None:
    """Raise ``InvalidValueError`` for an unknown kind, a room that is none, too many boxes."""
    if not file.plan and not file.walls:
        raise InvalidValueError("walls must be one polyline or more, or plan a file; got neither")
    boxes = {"walls": sum(len(line) - 1 for line in file.walls),
             "things": sum(len(thing.boxes) for thing in file.things)}  # fmt: skip
    for key, n in boxes.items():
        if n > MOST_BOXES:
            raise InvalidValueError(f"{key} must be at most {MOST_BOXES} boxes, got {n}")
    for k, (a, b, c, d) in enumerate(file.rooms):
        if not (a < c and b < d):
            got = (a, b, c, d)
            raise InvalidValueError(f"rooms[{k}] must be [xmin, ymin, xmax, ymax], got {got}")
    movers = [kind for kind, row in KINDS.items() if row.group in PUSHED]
    for k, (kind, *_) in enumerate(file.put):
        one_of(f"put[{k}]", kind, (*furniture(), *movers))
    for k, thing in enumerate(file.things):
        one_of(f"things[{k}].kind", thing.kind, movers)


def files(path: Path) -> tuple[Path, ...]:
    """A scene's file, and those beside it that it names: its plan and its robot."""
    own = tables(path) if path.suffix == ".toml" else {}
    named = [name for name in (own.get("plan"), own.get("robot")) if isinstance(name, str)]
    return path, *(beside(path, name) for name in named if is_file(name))


def sha256_of(scene: str) -> str | None:
    """Of all ``files`` of a scene by its file; None for another."""
    if not is_file(scene):
        return None
    each = [hashlib.sha256(bytes_of(f, MAX_BYTES)).digest() for f in files(Path(scene))]
    return hashlib.sha256(b"".join(each)).hexdigest()


def located(scene: str) -> str:
    """A scene by its file that a result names, from where the result was made: above it, else here.

    Raises ``MissingPathError`` where it is in none of these; any other name stays.
    """
    if not (is_file(scene) and isinstance(scene, NameFromFile)):
        return scene
    for folder in (*Path(scene.file).absolute().parents, Path()):
        if (folder / scene).is_file():
            return NameFromFile(os.path.relpath(folder / scene), scene.file)
    raise MissingPathError(
        Path(scene), f"no such file here or above {scene.file}: run this in the folder that has it"
    )


def changed(scene: str, sha256: str | None) -> str:
    """What says that a scene's files are others than those with that hash; "" where they are not,
    or where no hash is known."""
    now = sha256_of(scene) if sha256 is not None else None
    if now == sha256:
        return ""
    return f"is not what was recorded, it or its plan or robot: SHA-256 then {sha256}, now {now}"
