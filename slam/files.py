# SPDX-License-Identifier: Apache-2.0
"""Writing so that nothing half-written is ever seen, nor after the power has failed.

A thing is written under a temporary name, ``.STEM.PID.part.SUFFIX`` or ``.NAME.PID.part``. Its
bytes are synced to the disk, it is renamed, and the folder that holds the name is synced: once for
each finished thing. What lies in a folder of such a name is synced with the folder, not singly.
"""

import ctypes
import errno
import fcntl
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

from slam import inputs
from slam.errors import OutputError

PART = ".part"
SYNCS_AT_ONCE = 8
NEARLY_FULL_BYTES = 1 << 20  # less is free: a writer that fails without a reason lacked space
_PART = re.compile(r"\..+\.part(\..*)?", re.DOTALL)
_FULL = (errno.ENOSPC, errno.EDQUOT)
_VAGUE = (None, errno.EPIPE, errno.EIO)  # what libraries and pipes make of a full disk
_UNSYNCED = (errno.EINVAL, errno.ENOTSUP, errno.EACCES)  # folders of some file systems
_EXCHANGE, _HERE = 2, -100  # RENAME_EXCHANGE, AT_FDCWD of Linux
UNFOLLOWED = os.O_NOFOLLOW | os.O_NONBLOCK  # opens no link, and waits at no named pipe


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; rename it onto ``path`` when the block succeeds.

    On any exception, Ctrl-C included, the temporary file and the folders made for it are removed
    and ``path`` stays as it was. What killed runs left of ``path`` is removed first. The suffix of
    ``path`` is kept, because writers choose formats by it. Raises ``OutputError`` when it cannot be
    written, or is read by the same command.
    """
    if not path.name:
        raise OutputError(f"cannot write {path}: not a file name")
    inputs.refuse(path)
    temporary = part_of(path)
    made: list[Path] = []
    done = False
    try:
        made = make_folder(path.parent)
        clear_parts(path)
        temporary.unlink(missing_ok=True)
        temporary.touch(exist_ok=False)  # a file of its own, whatever lies there
        with locked(temporary):
            yield temporary
            put(temporary, path)
        done = True
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"cannot write {path}: {reason(error, path.parent)}") from error
    finally:
        if not done:
            with suppress(OSError):
                temporary.unlink()
            remove_empty(made)


def write_bytes(path: Path, data: bytes) -> None:
    """``path.write_bytes`` that appears whole or not at all."""
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def write_text(path: Path, text: str) -> None:
    """``path.write_text`` in UTF-8 that appears whole or not at all."""
    try:
        write_bytes(path, text.encode("utf-8"))
    except UnicodeEncodeError as error:
        raise OutputError(f"cannot write {path}: it would hold a name that is no UTF-8") from error


def refuse_unwritable(path: Path) -> None:
    """``OutputError`` where nothing can be written at ``path``, before work is done for it."""
    there = next(p for p in (path.absolute(), *path.absolute().parents) if os.path.lexists(p))
    if there != path.absolute() and not there.is_dir():
        raise OutputError(f"cannot write {path}: {there} is no folder")
    folder = there if there.is_dir() else there.parent
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(f"cannot write {path}: {os.strerror(errno.EACCES)} in {folder}")


def part_of(path: Path) -> Path:
    """The temporary name of a file."""
    return path.with_name(f".{path.stem}.{os.getpid()}{PART}{path.suffix}")


def is_part(name: str) -> bool:
    """Whether a name is that of something unfinished, perhaps left by a run that was killed."""
    return _PART.fullmatch(name) is not None


def unfinished(path: Path) -> bool:
    """Whether ``path`` lies in a folder that is not whole yet."""
    return any(is_part(name) for name in path.absolute().parts[:-1])


def sync(path: Path) -> None:
    """Wait until the bytes of a file, or the names in a folder, are on the disk."""
    number = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno not in _UNSYNCED:
            raise
    finally:
        os.close(number)


def sync_names(folder: Path) -> None:
    """``sync`` of a folder that we may be allowed to write and not to read."""
    with suppress(PermissionError):
        sync(folder)


def sync_tree(path: Path) -> None:
    """``sync`` of a file, or of a folder and everything in it, each once.

    Files of a folder are synced side by side: the disk then writes its journal once for all.
    """
    if not path.is_dir():
        sync(path)
        return
    with ThreadPoolExecutor(SYNCS_AT_ONCE) as pool:
        for folder, _, names in os.walk(path, topdown=False):
            inside = [Path(folder, name) for name in sorted(names)]
            list(pool.map(sync, [file for file in inside if stat.S_ISREG(file.lstat().st_mode)]))
            sync(Path(folder))


def put(temporary: Path, path: Path) -> None:
    """Rename a whole file or folder onto ``path``; both its bytes and its name are on the disk."""
    if unfinished(path):
        os.replace(temporary, path)
        return
    sync_tree(temporary)
    os.replace(temporary, path)
    sync_names(path.parent)


def make_folder(path: Path) -> list[Path]:
    """Make a folder and those above it, durably; the ones that were not there, innermost first."""
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    if not unfinished(path):
        for folder in made:
            sync_names(folder.parent)
    return made


def remove_empty(folders: list[Path]) -> None:
    """Take back what ``make_folder`` made; one that something was put into stays."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def refuse_links(*paths: Path) -> None:
    """``OutputError`` where one of these, or anything in them, is neither a file nor a folder.

    What we write through a link lands elsewhere, what we write to a named pipe waits for ever.
    """
    waiting = list(paths)
    while waiting:
        path = waiting.pop()
        with suppress(FileNotFoundError):  # of a worker, that has ended meanwhile
            mode = path.lstat().st_mode
            if stat.S_ISDIR(mode):
                waiting += path.iterdir()
            elif not stat.S_ISREG(mode):
                what = "a link" if stat.S_ISLNK(mode) else "no file"
                raise OutputError(f"{path} is {what}, in a folder that is written: move it away")


def exchange(first: Path, second: Path) -> bool:
    """Swap the names of two things at once; False where the system cannot."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    if rename(_HERE, os.fsencode(first), _HERE, os.fsencode(second), _EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP):
        return False
    raise OSError(number, os.strerror(number), str(second))


@contextmanager
def locked(part: Path) -> Iterator[None]:
    """While a temporary file or folder is being written, nobody takes it for a left one."""
    number = os.open(part, os.O_RDONLY | UNFOLLOWED)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(number)


def clear_parts(path: Path) -> None:
    """Remove the temporary files and folders of ``path`` that nobody is writing any more."""
    if unfinished(path):
        return
    names = {(path.stem, path.suffix), (path.name, "")}
    of_path = "|".join(
        rf"\.{re.escape(stem)}\.\d+\.part{re.escape(suffix)}" for stem, suffix in sorted(names)
    )
    for name in os.listdir(path.parent):
        if re.fullmatch(of_path, name) and _is_left(path.with_name(name)):
            remove(path.with_name(name))


def _is_left(part: Path) -> bool:
    try:
        number = os.open(part, os.O_RDONLY | UNFOLLOWED)
    except OSError:
        return False
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(number)
    return True


def remove(path: Path) -> None:
    """A file, a link or a whole folder; without a word when that cannot be."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
        return
    with suppress(OSError):
        path.unlink()


def reason(error: OSError, folder: Path) -> str:
    """In words, why something could not be written in ``folder``.

    A full disk is reported as one, whatever a library or a broken pipe made of it.
    """
    chain = _chain(error)
    if is_full(error, folder):
        number = next((e.errno for e in chain if e.errno in _FULL), None) or errno.ENOSPC
        elsewhere = "" if _free_bytes(folder) < NEARLY_FULL_BYTES else _full_scratch()
        return os.strerror(number) + elsewhere
    cause = next((e for e in chain if e.strerror), error)
    return cause.strerror or str(error).strip().partition("\n")[0] or type(error).__name__


def is_full(error: OSError, folder: Path) -> bool:
    """Whether something failed for want of space."""
    if any(e.errno in _FULL for e in _chain(error)):
        return True
    return error.errno in _VAGUE and _free_bytes(folder) < NEARLY_FULL_BYTES


def _chain(error: BaseException) -> list[OSError]:
    """An error and those that it came from."""
    seen: list[BaseException] = []
    link: BaseException | None = error
    while link is not None and link not in seen:
        seen.append(link)
        link = link.__cause__ or link.__context__
    return [e for e in seen if isinstance(e, OSError)]


def _full_scratch() -> str:
    """Where libraries put what they need for a while and find no room."""
    places = [Path(tempfile.gettempdir()), Path("/dev/shm")]
    full = [str(place) for place in places if _free_bytes(place) < NEARLY_FULL_BYTES]
    return f" for temporary files ({', '.join(full)})" if full else ""


def _free_bytes(folder: Path) -> int:
    """For us, on the disk of a folder or of the nearest one above that is there."""
    for place in (folder, *folder.absolute().parents):
        with suppress(OSError):
            there = os.statvfs(place)
            return there.f_bavail * there.f_frsize
    return 0


_BEGINS = frozenset("=+-@\t\r")
_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?([eE][-+]?\d+)?|inf|nan)")


def cell_of(word: str) -> str:
    """The cell that holds this word."""
    return f"'{word}" if _is_formula(word) and not _NUMBER.fullmatch(word) else word


def word_of(cell: str) -> str:
    """The word that this cell holds."""
    return cell[1:] if cell.startswith("'") and _is_formula(cell) else cell


def _is_formula(text: str) -> bool:
    """What has more apostrophes in front counts too, so that every word comes back the same."""
    return text.lstrip("'")[:1] in _BEGINS
