# SPDX-License-Identifier: Apache-2.0
"""What can go wrong, by cause.

Every message names the file or field, the value, and what was expected. It is one line of printable
characters, whatever a guest or a file says in it.
"""

import difflib
import importlib
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType


def printable(words: str) -> str:
    """Somebody's words in one line that nothing obeys: whatever does not print is its escape.

    That is every control character, ESC and the ends of lines among them, and every mark that turns
    the direction of reading.
    """
    if words.isprintable():
        return words
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in words)


def meant(name: str, known: Iterable[str], cutoff: float = 0.6) -> str:
    """`` Did you mean 'office'?`` for the known name that is nearest; "" where none is near."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=cutoff)
    return f" Did you mean '{near[0]}'?" if near else ""


class MobiliaError(Exception):
    """Base of every error raised on purpose; the command line prints it as one line."""

    def __init__(self, *words: object) -> None:
        super().__init__(*(printable(w) if isinstance(w, str) else w for w in words))


class InvalidValueError(MobiliaError, ValueError):
    """A field, argument or option has a value it cannot have."""


class NotFiniteError(InvalidValueError):
    """A number that must be finite is NaN or infinite."""


class UnknownNameError(MobiliaError, LookupError):
    """A scene, SLAM or preset of that name is not registered."""

    def __str__(self) -> str:  # LookupError subclasses such as KeyError would quote the message
        return str(self.args[0]) if self.args else ""


class NeedsLabelsError(InvalidValueError):
    """An oracle was given a frame without labels: there is no truth to take returns out by."""


class UntrustedNameError(MobiliaError):
    """A file names code to run, which opening it must not do."""


class LogFormatError(MobiliaError):
    """A log or recording cannot be read: which file, which line, what was expected there."""

    def __init__(self, path: str | Path, message: str, line: int | None = None) -> None:
        self.path = Path(path)
        self.message = printable(message)
        self.line = line
        where = f"{path}:{line}" if line is not None else f"{path}"
        super().__init__(f"{where}: {message}")

    def __reduce__(self) -> tuple[type, tuple[str, str, int | None]]:
        """So that it comes back whole from another process."""
        return type(self), (str(self.path), self.message, self.line)


class MissingPathError(LogFormatError):
    """A file or folder that was named is not there; ``verify`` ends with status 2, as for usage."""


FAILURES = ("raised", "hung", "nan", "bad")


class SlamFailedError(MobiliaError):
    """A SLAM failed; says which one and at which scan.

    outcome  "raised": it raised, or its process ended; "hung": no answer within its time limit;
             "nan": a pose or covariance that is not finite; "bad": anything else that is no
             answer: another type, length or stamp, or words outside the protocol
    """

    def __init__(self, message: str, outcome: str = "raised") -> None:
        if outcome not in FAILURES:
            raise InvalidValueError(
                f"outcome must be one of {', '.join(FAILURES)}, got {outcome!r}"
            )
        self.message = printable(message)
        self.outcome = outcome
        super().__init__(self.message)

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """So that it comes back whole from another process."""
        return type(self), (self.message, self.outcome)

    def at(self, where: str) -> "SlamFailedError":
        """The same failure, with the place before its words."""
        return type(self)(f"{where} {self.message}", self.outcome)


class UnstableError(MobiliaError):
    """The physics of a simulation failed; says when, and at which joint."""


class OutputError(MobiliaError, OSError):
    """An output file or folder cannot be written."""


class MissingDependencyError(MobiliaError, ImportError):
    """An optional part is needed and not installed; the message says how to get it."""


def needed(module: str, package: str, extra: str = "guests") -> ModuleType:
    """A package's module; raises ``MissingDependencyError`` that says how to get it."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(
            f"'{package}' cannot be imported ({error}): pip install 'mobilia[{extra}]'"
        ) from error
