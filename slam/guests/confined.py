# SPDX-License-Identifier: Apache-2.0
"""What a program behind ``pipe:`` may see: its own folder and the system, but no results.

Linux's Landlock (5.13) does it, without any rights of the user's: the guard (``guard``) gives up
for the guest all files but those listed here. With them go the memory, the descriptors and the
environment of all other processes, for which the kernel asks the same question.
"""

import ctypes
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import mobilia
from slam.errors import InvalidValueError

MORE = "MOBILIA_GUEST_FOLDERS"  # of the user's environment: folders that guests read and write too
EVERYTHING = "all"  # as ``MORE``: guests are not confined
WHOLE = 3  # version from which on a file cannot be emptied either (Linux 6.2)
RESULTS = "out"  # folder in the working folder, where results lie unless --out says otherwise
LISTED, READ, WRITTEN = 0, 1, 2  # what may be done in a folder and in all that it holds
_SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/etc", "/opt", "/nix", "/snap",
           "/run", "/proc", "/sys")  # fmt: skip
_DEVICES = ("null", "zero", "full", "random", "urandom", "shm", "dri", "kfd", "dxg")
_BINARIES = ("bin", "sbin", "shims", "Scripts")  # folders of programs, whose libraries lie beside
_CREATE_RULESET, _VERSION = 444, 1  # linux/landlock.h; the number is the same on all processors


def kernel_version() -> int:
    """Version of Landlock's interface, 0 where the kernel has none, or has it switched off."""
    if sys.platform != "linux":
        return 0
    return max(0, int(ctypes.CDLL(None).syscall(_CREATE_RULESET, None, 0, _VERSION)))


def rules(
    command: Sequence[str], environment: Mapping[str, str], hidden: Iterable[Path] = ()
) -> list[tuple[str, int]] | None:
    """Paths that ``command`` may see, and what it may do in each; None: the kernel has no rules.

    hidden  folders of results, beside ``RESULTS``: nothing in them, wherever they lie

    Raises ``InvalidValueError`` for a folder in ``MORE`` that is not there.
    """
    if not kernel_version() or environment.get(MORE) == EVERYTHING:
        return None
    never = {path.resolve() for path in (Path.cwd() / RESULTS, *hidden)}
    found: dict[Path, int] = {}
    for root in _more(environment.get(MORE, "")):
        _add(found, root, never, WRITTEN)
    for root in _there(_devices()):
        found[root] = WRITTEN
    for root in _there((*_SYSTEM, *_own(command), *_on_paths(command, environment))):
        _add(found, root, never, READ)
    home = Path(mobilia.HOME)
    found.setdefault(home, LISTED)  # to find the two
    for package in ("slam", "mobilia"):
        _add(found, home / package, never, READ)
    return [(str(path), may) for path, may in found.items()]


def _add(found: dict[Path, int], root: Path, never: set[Path], may: int) -> None:
    """``root`` without what it holds of ``never``: its folders one by one, where it holds some."""
    if any(root.is_relative_to(path) for path in never):
        return
    if not any(path.is_relative_to(root) for path in never):
        found[root] = max(may, found.get(root, may))
        return
    found.setdefault(root, LISTED)
    try:
        entries = list(os.scandir(root))
    except OSError:
        return  # not ours to read: not the guest's either
    for entry in entries:
        if not entry.is_symlink():  # it leads to what has a rule of its own, or none
            _add(found, root / entry.name, never, may)


def _more(folders: str) -> Iterator[Path]:
    for folder in filter(None, folders.split(os.pathsep)):
        path = Path(folder).expanduser()
        if not path.is_dir():
            raise InvalidValueError(f"{MORE} must name folders that exist, got {folder!r:.80}")
        yield path.resolve()


def _there(paths: Iterable[str]) -> Iterator[Path]:
    """Those that exist, resolved."""
    for path in paths:
        if path and os.path.exists(path):
            yield Path(path).resolve()


def _devices() -> Iterator[str]:
    yield from (f"/dev/{name}" for name in _DEVICES)
    yield from (str(path) for path in Path("/dev").glob("nvidia*"))


def _own(command: Sequence[str]) -> set[str]:
    """The folders of the files that the command names; the working folder if it names none beside
    the program.
    """
    given = [word for word in command[1:] if os.path.exists(word)]
    named = [command[0], *given] if os.sep in command[0] else given
    folders = {word if os.path.isdir(word) else os.path.dirname(word) or "." for word in named}
    real = {os.path.dirname(os.path.realpath(word)) for word in named}
    return folders | real | (set() if given else {"."})


def _on_paths(command: Sequence[str], environment: Mapping[str, str]) -> Iterator[str]:
    """What a PATH, a PYTHONPATH, an LD_LIBRARY_PATH … names, and where installed programs lie."""
    for name, value in environment.items():
        if name.endswith("PATH"):
            for folder in value.split(os.pathsep):
                if os.path.isabs(folder):
                    yield from _installed(folder)
    program = shutil.which(command[0], path=environment.get("PATH")) or command[0]
    for path in (program, os.path.realpath(program)):
        yield from _installed(os.path.dirname(path))


def _installed(folder: str) -> Iterator[str]:
    """A folder of programs, and that of the installation: ~/.local of ~/.local/bin."""
    yield folder
    above = os.path.dirname(folder.rstrip(os.sep))
    of_home = Path.home().is_relative_to(os.path.realpath(above))  # not ~ of ~/bin
    if os.path.basename(folder.rstrip(os.sep)) in _BINARIES and not of_home:
        yield above
