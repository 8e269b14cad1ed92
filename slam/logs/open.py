# SPDX-License-Identifier: Apache-2.0
"""One entry for all logs: the format follows from what is in the file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from slam.errors import LogFormatError
from slam.frames import Stream
from slam.logs.bag import read_bag
from slam.logs.bag_topics import is_bag
from slam.logs.carmen import read_carmen
from slam.logs.carmen_messages import KNOWN_NAMES
from slam.logs.text import numbered_lines
from slam.logs.victoria_park import is_victoria_park, read_victoria_park

_LINES_TO_LOOK_AT = 1000


@dataclass(frozen=True, kw_only=True)
class LogFormat:
    """``recognises`` may raise ``LogFormatError``; ``read`` gives the stream."""

    description: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path], Stream]


def _is_carmen(path: Path) -> bool:
    """True when one of the first thousand lines begins with the name of a CARMEN message."""
    lines = islice(numbered_lines(path), _LINES_TO_LOOK_AT)
    return any(line.split(maxsplit=1)[:1] in KNOWN_NAMES for _, line in lines)


FORMATS: tuple[LogFormat, ...] = (
    LogFormat(
        description="bag of ROS 2 (its folder, .mcap or .db3) or of ROS 1 (.bag)",
        recognises=is_bag,
        read=read_bag,
    ),
    LogFormat(
        description="Victoria Park (its folder, features_*.mat or rfs_measurements.dat)",
        recognises=is_victoria_park,
        read=read_victoria_park,
    ),
    LogFormat(
        description="CARMEN text log (.log, .log.gz, .log.xz)",
        recognises=_is_carmen,
        read=read_carmen,
    ),
)


def open_log(path: str | Path) -> Stream:
    """The log at ``path`` as a stream of frames, whatever its format.

    Raises ``LogFormatError`` when the file is missing, damaged or of no known format.
    """
    path = Path(path)
    for log_format in FORMATS:
        if log_format.recognises(path):
            return log_format.read(path)
    known = "; ".join(log_format.description for log_format in FORMATS)
    raise LogFormatError(path, f"of no known format; known: {known}")
