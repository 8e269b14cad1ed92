# SPDX-License-Identifier: Apache-2.0
"""What a SLAM is to this project: a protocol of four methods, and what else it may have.

    class MySlam:
        def reset(self) -> None: ...
        def update(self, frame: Frame) -> Estimate: ...
        def map(self) -> Raster | None: ...
        def trajectory(self) -> Trajectory: ...

``HasLandmarks``, ``HasChanges``, ``CanSave``, ``SaysCells``, ``TakesSeveral`` and ``RunsAtTheEnd``
are optional.
Who wants one of these asks whether it is there (``slam.replay.Track``), never for a class.
"""

import inspect
import os
import sysconfig
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from slam.errors import InvalidValueError
from slam.estimate import Changes, Estimate, Landmarks, Raster
from slam.frames import Float, Frame
from slam.trajectory import Trajectory

_FOLDERS = (*map(sysconfig.get_path, ("stdlib", "purelib", "platlib")), str(Path(__file__).parent))
_LIBRARIES = ("<frozen ", "<string>", *(folder + os.sep for folder in _FOLDERS))


@runtime_checkable
class SlamSystem(Protocol):
    """One SLAM. ``update`` gets frames in the order of their stamps, the first at the origin."""

    def reset(self) -> None:
        """Forget everything; the next frame is the first."""

    def update(self, frame: Frame) -> Estimate:
        """Take a frame in, say where the robot is. Must not read ``frame.truth`` or ``labels``."""

    def map(self) -> Raster | None:
        """The map now, or None for a system without one."""

    def trajectory(self) -> Trajectory:
        """Final poses of all frames so far; the online ones where nothing better exists."""


@runtime_checkable
class HasLandmarks(Protocol):
    """Optional: a map of points. The film draws its ellipses, the paper's figures count them."""

    def landmarks(self) -> Landmarks:
        """The landmarks now."""


@runtime_checkable
class HasChanges(Protocol):
    """Optional: a map that knows what moved. A run draws it as ``changes.png``."""

    def changes(self) -> Changes | None:
        """What appeared and what is gone lately, None where nothing can be said."""


@runtime_checkable
class CanSave(Protocol):
    """Optional: a map that can be kept. A run writes it as ``map.npz``."""

    def save(self, path: Path) -> None:
        """Write the map; raises ``OutputError``."""


@runtime_checkable
class MovingMap(Protocol):
    """Optional: a map that closed loops move. ``diagnostics["correction"]`` is not zero then."""

    def poses_in_map(self) -> Float:
        """(n, 3) of all frames so far in the map as it is now."""


@runtime_checkable
class SaysCells(Protocol):
    """Optional: what the cells of ``map()`` hold, for titles: "probabilities", "activities"."""

    cells_hold: str


@runtime_checkable
class TakesSeveral(Protocol):
    """Optional: True where scans of several scanners may come, told apart by ``LaserSpec.mount``.

    Others get those of the first (``slam.one_scanner``).
    """

    takes_several: bool


@runtime_checkable
class RunsAtTheEnd(Protocol):
    """Optional: a program over files. ``update`` reports odometry's pose until the last frame."""

    def estimates_at_end(self) -> Sequence[tuple[Estimate, float]]:
        """Of each frame so far, in order: the estimate, and the processor time it took, s.

        Each estimate must be of its frame and those before it: it is scored as an online one.
        """


def refuse_at_the_end(system: object, name: str, what: str) -> None:
    """``InvalidValueError`` for a SLAM that runs at the end, where ``what`` needs poses before."""
    if isinstance(system, RunsAtTheEnd):
        raise InvalidValueError(
            f"SLAM '{name}' is a program over files: it has no pose before the last scan, "
            f"and {what} needs one at every scan"
        )


def told(error: BaseException, method: object = None) -> str:
    """An exception of somebody else's code in one line: type, words, and their last line in it.

    That is the last line outside Python's library, installed packages and this one: where their
    code called NumPy, not the line of NumPy that raised. Where there is none, what was wrong is
    what their ``method`` returned: it is named.
    """
    words = str(error).strip().partition("\n")[0]
    what = f"{type(error).__name__}: {words}" if words else type(error).__name__
    trace = traceback.extract_tb(error.__traceback__)
    theirs = [at for at in trace if not at.filename.startswith(_LIBRARIES)]
    if not theirs and (place := place_of(method)):
        return what + place
    last = (theirs or trace)[-1:]
    return what + "".join(_place(at.filename, at.lineno) for at in last)


def place_of(method: object) -> str:
    """`` (my_slam.py:12)``: where somebody else's method begins, a guest's ``locate`` where
    ``update`` is ours; "" for one of ours."""
    for one in (method, getattr(getattr(method, "__self__", None), "locate", None)):
        code = getattr(inspect.unwrap(one), "__code__", None) if callable(one) else None
        if code is not None and not code.co_filename.startswith(_LIBRARIES):
            return _place(code.co_filename, code.co_firstlineno)
    return ""


def _place(file: str, line: int | None) -> str:
    return f" ({Path(file).name}:{line})"
