# SPDX-License-Identifier: Apache-2.0
"""Messages that a client publishes on topics of its own: twists, clicked points, clicked poses."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from scripts.live.requests import (
    FAR_M,
    MOST_LETTERS,
    MOST_TWIST,
    Drive,
    Kidnap,
    Request,
    Touch,
    json_object,
    within,
)
from slam.errors import InvalidValueError

CMD_VEL, TOUCH, KIDNAP = "/cmd_vel", "/touch", "/kidnap"


def _part(what: str, message: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """A field that is an object; what is not given is empty, as in a message full of zeros."""
    part = message.get(key, {})
    if not isinstance(part, dict):
        raise InvalidValueError(f"{what}.{key} must be an object, got {part!r:.60}")
    return part


def _number(what: str, part: Mapping[str, Any], key: str, most: float) -> float:
    return within(f"{what}.{key}", part.get(key, 0.0), -most, most)


def _frame(what: str, message: Mapping[str, Any]) -> str:
    frame = _part(what, message, "header").get("frame_id", "")
    if not isinstance(frame, str) or len(frame) > MOST_LETTERS:
        raise InvalidValueError(f"{what}.header.frame_id must be a name, got {frame!r:.60}")
    return frame.lstrip("/")


def twist(what: str, message: Mapping[str, Any]) -> Drive:
    """``geometry_msgs/Twist`` or ``TwistStamped``."""
    inner = _part(what, message, "twist") if "twist" in message else message
    if not {"linear", "angular"} & inner.keys():
        raise InvalidValueError(f"{what}: a twist has linear and angular, got {list(inner)!r:.80}")
    linear, angular = _part(what, inner, "linear"), _part(what, inner, "angular")
    return Drive(
        v=_number(f"{what}.linear", linear, "x", MOST_TWIST),
        omega=_number(f"{what}.angular", angular, "z", MOST_TWIST),
    )


def point(what: str, message: Mapping[str, Any]) -> Touch:
    """``geometry_msgs/PointStamped``."""
    place = _part(what, message, "point")
    if not {"x", "y"} <= place.keys():
        raise InvalidValueError(f"{what}.point must have x and y, got {list(place)!r:.60}")
    x, y = (_number(f"{what}.point", place, key, FAR_M) for key in ("x", "y"))
    return Touch(x=x, y=y, frame=_frame(what, message))


def pose(what: str, message: Mapping[str, Any]) -> Kidnap:
    """``geometry_msgs/PoseStamped``."""
    inner = _part(what, message, "pose")
    place, turn = _part(what, inner, "position"), _part(what, inner, "orientation")
    if not {"x", "y"} <= place.keys():
        raise InvalidValueError(f"{what}.pose.position must have x and y, got {list(place)!r:.60}")
    x, y = (_number(f"{what}.pose.position", place, key, FAR_M) for key in ("x", "y"))
    qz, qw = (_number(f"{what}.pose.orientation", turn, key, 1.001) for key in ("z", "w"))
    yaw = 2.0 * math.atan2(qz, qw) if turn else 0.0
    return Kidnap(pose=(x, y, yaw), frame=_frame(what, message))


TOPICS: dict[str, Callable[[str, Mapping[str, Any]], Request]] = {
    CMD_VEL: twist, TOUCH: point, KIDNAP: pose,
}  # fmt: skip


def read(topic: str, encoding: str, data: bytes) -> Request:
    """The request in a message on ``topic``; ``InvalidValueError`` for one that is none."""
    if topic not in TOPICS:
        raise InvalidValueError(f"nobody listens on '{topic:.60}', only on {', '.join(TOPICS)}")
    if encoding != "json":
        raise InvalidValueError(f"{topic}: messages must be JSON, got '{encoding:.20}'")
    return TOPICS[topic](topic, json_object(topic, data))
