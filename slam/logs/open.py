# SPDX-License-Identifier: Apache-2.0
"""One entry for all logs: the format follows from what is in the file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from slam.errors import LogFormatError
from slam.frames import Stream
from slam.logs.bag import read_bag
from slam.logs.bag_topics import is_bag
from slam.logs.carmen import is_carmen, read_carmen
from slam.logs.centimetre import is_centimetre, read_centimetre
from slam.logs.foreign import what_instead
from slam.logs.rawlog import is_rawlog, read_rawlog
from slam.logs.rover import read_format, read_rover
from slam.logs.victoria_park import is_victoria_park, read_victoria_park

_NAMED = 3  # recordings of a folder that a message names


@dataclass(frozen=True)
class LogFormat:
    """``recognises`` may raise ``LogFormatError``; ``read(path, strict)`` gives the stream."""

    description: str
    recognises: Callable[[Path], bool]
    read: Callable[[Path, bool], Stream]


FORMATS: tuple[LogFormat, ...] = (
    LogFormat(
        "bag of ROS 2 (its folder, .mcap or .db3) or of ROS 1 (.bag)",
        is_bag,
        lambda path, strict: read_bag(path, strict=strict),
    ),
    LogFormat(
        "Victoria Park (its folder or features_trees.mat)",
        is_victoria_park,
        lambda path, _: read_victoria_park(path),
    ),
    LogFormat(
        "MRPT rawlog (.rawlog)",
        is_rawlog,
        lambda path, strict: read_rawlog(path, strict=strict),
    ),
    LogFormat(
        "CARMEN text log (.log, .clf, .log.gz, .log.xz)",
        is_carmen,
        lambda path, strict: read_carmen(path, strict=strict),
    ),
    LogFormat(
        "L/O text log in centimetres",
        is_centimetre,
        lambda path, strict: read_centimetre(path, strict=strict),
    ),
)


_registered: list[LogFormat] = []


def register(log_format: LogFormat) -> LogFormat:
    """One more format, asked after those of ``FORMATS``; a file of one's own calls this."""
    _registered.append(log_format)
    return log_format


def open_log(
    path: str | Path, *, strict: bool = False, text_format: str | Path | None = None
) -> Stream:
    """The log at ``path`` as a stream of frames, whatever its format.

    strict       refuse what would be repaired: torn lines, a clock that steps back, no odometry
    text_format  a TOML file that describes the columns of a text log (``slam.logs.rover``);
                 without it, the format follows from what is in the file

    Raises ``LogFormatError`` when the file is missing, damaged or of no known format.
    """
    path = Path(path)
    log_format = format_of(path, text_format)
    if log_format is None:
        return read_rover(path, str(text_format), strict=strict)
    return log_format.read(path, strict)


def format_of(path: Path, text_format: str | Path | None = None) -> LogFormat | None:
    """What the log at ``path`` is, None with a ``text_format``; raises as ``open_log``, of what a
    glance tells.
    """
    if not is_bag(path) and (what := what_instead(path)):  # a bag says it itself
        raise LogFormatError(path, what)
    if text_format is not None:
        read_format(text_format)
        return None
    if path.is_dir() and not (is_bag(path) or is_victoria_park(path)):
        raise LogFormatError(path, _what_folder(path))
    for log_format in (*FORMATS, *_registered):
        if log_format.recognises(path):
            return log_format
    known = "; ".join(log_format.description for log_format in (*FORMATS, *_registered))
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
    if poses := sorted(one.name for one in path.glob("trajectory_*.tum")):
        return (
            f"is of a run, and has its poses as TUM: {', '.join(poses)}. Its scans are in the log "
            "or the scene that it was on; an episode of mobilia generate keeps both"
        )
    if not inside:
        return "is a folder, not a regular file, and neither a bag nor Victoria Park"
    few = ", ".join(inside[:_NAMED]) + (", ..." if len(inside) > _NAMED else "")
    return f"is a folder, not a regular file; name one of the recordings in it: {few}"
