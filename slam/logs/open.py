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
from slam.logs.centimetre import is_centimetre, read_centimetre
from slam.logs.rawlog import is_rawlog, read_rawlog
from slam.logs.repairs import Repairs
from slam.logs.rover import read_rover
from slam.logs.text import numbered_lines
from slam.logs.victoria_park import is_victoria_park, read_victoria_park

_LINES_TO_LOOK_AT = 1000
_NAMED = 3  # recordings of a folder that a message names


@dataclass(frozen=True, kw_only=True)
class LogFormat:
    """``recognises`` may raise ``LogFormatError``; ``read(path, strict)`` gives the stream."""

    description: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path, bool], Stream]


def _is_carmen(path: Path) -> bool:
    """True when one of the first thousand lines begins with the name of a CARMEN message."""
    lines = islice(numbered_lines(path, Repairs(path)), _LINES_TO_LOOK_AT)
    return any(line.split(maxsplit=1)[:1] in KNOWN_NAMES for _, line in lines)


FORMATS: tuple[LogFormat, ...] = (
    LogFormat(
        description="bag of ROS 2 (its folder, .mcap or .db3) or of ROS 1 (.bag)",
        recognises=is_bag,
        read=lambda path, strict: read_bag(path, strict=strict),
    ),
    LogFormat(
        description="Victoria Park (its folder, features_*.mat or rfs_measurements.dat)",
        recognises=is_victoria_park,
        read=lambda path, _: read_victoria_park(path),
    ),
    LogFormat(
        description="MRPT rawlog (.rawlog)",
        recognises=is_rawlog,
        read=lambda path, strict: read_rawlog(path, strict=strict),
    ),
    LogFormat(
        description="CARMEN text log (.log, .clf, .log.gz, .log.xz)",
        recognises=_is_carmen,
        read=lambda path, strict: read_carmen(path, strict=strict),
    ),
    LogFormat(
        description="L/O text log in centimetres",
        recognises=is_centimetre,
        read=lambda path, strict: read_centimetre(path, strict=strict),
    ),
)


def open_log(
    path: str | Path, *, strict: bool = False, text_format: str | Path | None = None
) -> Stream:
    """The log at ``path`` as a stream of frames, whatever its format.

    strict       refuse what would be repaired: torn lines, a clock that steps back, no odometry
    text_format  a TOML file that describes the columns of a text log (``slam.logs.rover_format``);
                 without it, the format follows from what is in the file

    Raises ``LogFormatError`` when the file is missing, damaged or of no known format.
    """
    path = Path(path)
    if text_format is not None:
        return read_rover(path, text_format, strict=strict)
    if path.is_dir() and not (is_bag(path) or is_victoria_park(path)):
        raise LogFormatError(path, _what_folder(path))
    for log_format in FORMATS:
        if log_format.recognises(path):
            return log_format.read(path, strict)
    known = "; ".join(log_format.description for log_format in FORMATS)
    raise LogFormatError(
        path, f"of no known format; known: {known}; others by a description of their columns "
        "(--format)"
    )  # fmt: skip


def _what_folder(path: Path) -> str:
    """What a folder that is no log is instead: one of recordings, or of something else."""
    try:
        inside = sorted(child.name for child in path.iterdir() if is_bag(child))
    except OSError as error:
        return f"cannot be read: {error.strerror or error}"
    if not inside:
        return "is a folder, not a regular file, and neither a bag nor Victoria Park"
    few = ", ".join(inside[:_NAMED]) + (", ..." if len(inside) > _NAMED else "")
    return f"is a folder, not a regular file; name one of the recordings in it: {few}"
