# SPDX-License-Identifier: Apache-2.0
"""Topics of your own in the bag of an episode: a function that makes one message of a moment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from sim.moments import Moment
from sim.recording.label_cloud import LabelsMessage
from sim.recording.objects import ObjectsMessage
from slam.errors import InvalidValueError, UnknownNameError
from slam.ros.frames import SCANS, STATE
from slam.ros.template import STORE

Maker = Callable[[Moment], Any]
F = TypeVar("F", bound=Maker)
_topics: dict[str, tuple[str, Maker]] = {}
OURS = {  # by name their types, in the order of a bag's connections
    **STATE,
    "/ground_truth/objects": ObjectsMessage.KIND,
    "/ground_truth/labels": LabelsMessage.KIND,
    **SCANS,
}


def topic(name: str, kind: str) -> Callable[[F], F]:
    """Function decorator: write ``make(moment)`` under that name, once a frame.

    name  as ROS has it: "/robot/speed"
    kind  a ROS 2 type: "std_msgs/msg/Float64"; ``slam.ros.template.message`` makes one

    A frame for which the function returns None has no message. Raises ``InvalidValueError`` for a
    name that is taken or does not begin with '/', ``UnknownNameError`` for an unknown type.
    """
    if not name.startswith("/") or name in OURS or name in _topics:
        taken = ", ".join(sorted({*OURS, *_topics}))
        raise InvalidValueError(
            f"a topic needs a new name that begins with '/', got {name!r}. Taken: {taken}"
        )
    if kind not in STORE.types:
        raise UnknownNameError(f"topic {name}: no ROS 2 type is called {kind!r}")

    def add(make: F) -> F:
        _topics[name] = (kind, make)
        return make

    return add


def names() -> list[str]:
    """Registered topics, sorted."""
    return sorted(_topics)


class MoreTopics:
    """The registered topics of one bag."""

    def __init__(self) -> None:
        self._topics = dict(sorted(_topics.items()))
        self.kinds = {name: kind for name, (kind, _) in self._topics.items()}

    def __call__(self, moment: Moment) -> list[tuple[str, bytearray]]:
        """(topic, message) of those that have one now."""
        found = []
        for name, (kind, make) in self._topics.items():
            made = make(moment)
            if made is not None:
                found.append((name, bytearray(STORE.serialize_cdr(made, kind))))
        return found
