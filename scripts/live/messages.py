# SPDX-License-Identifier: Apache-2.0
"""What a page may send: five kinds of messages, each for a control that it was given.

Every field has its type and its limits, and a control takes what it offers: of a dropdown one of
its options, of a slider a number within its ends. viser checks none of it.
"""

import logging
import math
import time
from collections.abc import Callable
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from slam.shaped import FAR_M, MOST_LETTERS, Point

log = logging.getLogger(__name__)

SILENCE_S = 60.0  # between two lines about what was left out
_Share = Annotated[float, Meta(ge=-1.001, le=1.001)]  # of a unit quaternion or vector, rounded
_Pixels = Annotated[int, Meta(ge=1, le=100_000)]
_Far = Annotated[float, Meta(ge=0.0, le=FAR_M)]  # m
_Id = Annotated[str, Meta(max_length=MOST_LETTERS)]


class _Message(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="type"):
    """Fields as ``viser._messages`` has them."""


class _Camera(_Message, frozen=True, tag="ViewerCameraMessage"):
    wxyz: tuple[_Share, _Share, _Share, _Share]
    position: Point
    fov: Annotated[float, Meta(gt=0.0, lt=math.pi)]
    near: _Far
    far: _Far
    image_height: _Pixels
    image_width: _Pixels
    look_at: Point
    up_direction: Point


class _Click(_Message, frozen=True, tag="ScenePointerMessage"):
    event_type: Literal["click"]
    ray_origin: Point
    ray_direction: Point
    screen_pos: tuple[tuple[_Share, _Share]]  # of the picture's width and height
    modifier: None = None


class _Value(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    value: bool | float | Annotated[str, Meta(max_length=MOST_LETTERS)]


class _Update(_Message, frozen=True, tag="GuiUpdateMessage"):
    uuid: _Id
    updates: _Value


class _Hold(_Message, frozen=True, tag="GuiButtonHoldMessage"):
    uuid: _Id
    frequency: Annotated[float, Meta(gt=0.0, le=1000.0)]  # Hz


class _Key(_Message, frozen=True, tag="CommandTriggerMessage"):
    uuid: _Id


_DECODER = msgspec.msgpack.Decoder(_Camera | _Click | _Update | _Hold | _Key)


class Seldom:
    """Counts what pages should not do, and tells it, a line in ``SILENCE_S`` at most."""

    def __init__(self, what: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.count = 0
        self._what, self._clock, self._said_s = what, clock, -math.inf

    def note(self, why: object = "") -> None:
        """Once more."""
        self.count += 1
        if self._clock() - self._said_s >= SILENCE_S:
            self._said_s = self._clock()
            log.warning("live view: %s, %d so far%s", self._what, self.count, why and f": {why}")


class Controls:
    """What pages were given, and what each of it takes.

    left_out  counts messages that were none of these
    """

    def __init__(self) -> None:
        self.left_out = Seldom("messages of pages for no control of theirs")
        self._takes: dict[str, Any] = {}

    def add(self, handle: Any) -> None:
        """A control of viser's, or a command."""
        kind: Any = bool  # of a button; a command takes nothing
        if hasattr(handle, "options"):
            kind = Literal[tuple(handle.options)]
        elif hasattr(handle, "min"):
            kind = Annotated[float, Meta(ge=float(handle.min), le=float(handle.max))]
        self._takes[handle._impl.uuid] = kind

    def admits(self, message: bytes) -> bool:
        """Whether this is one for a control of ours; else it is counted, and told now and then."""
        try:
            words = _DECODER.decode(message)
            if isinstance(words, _Update):
                msgspec.convert(words.updates.value, self._takes[words.uuid])
            elif isinstance(words, _Hold | _Key):
                self._takes[words.uuid]
        except (ValueError, RecursionError, KeyError):  # msgspec's own errors are ValueErrors
            self.left_out.note()
            return False
        return True
