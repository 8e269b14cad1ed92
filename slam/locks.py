# SPDX-License-Identifier: Apache-2.0
"""Folders with one writer at a time, whose workers hold on to them too.

A writer that is killed frees its lock at once, its worker processes end a moment later. So there
are two files: ``.lock``, held by the writer, and ``.lock.workers``, held by its workers while they
do a job. The next writer waits until those have ended and writes a new ticket into the latter; a
worker that comes with an old ticket does nothing. Locks are ``flock``: over NFS they hold between
machines where the mount has them (not with ``nolock`` or ``local_lock``), for workers of one thread
each. What lies in a folder to be locked must be files and folders, no link above all.
"""

import fcntl
import os
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from slam.errors import OutputError
from slam.files import UNFOLLOWED, refuse_links

LOCK = ".lock"
WORKERS = ".lock.workers"
NAMES = frozenset((LOCK, WORKERS))  # in a folder that was left by a killed command
WAIT_S = 5.0  # for workers of a writer that is over
_AGAIN_S = 0.02


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """``folder``, which must exist, is this writer's alone.

    Raises ``OutputError`` when another writes there, or workers of one that is over still do after
    ``WAIT_S``, and as ``refuse_links``; ``OSError`` when the folder cannot be written.
    """
    refuse_links(*folder.iterdir())
    with _alone(folder):
        with _opened(folder / WORKERS) as workers:
            if not _got(workers, fcntl.LOCK_EX, WAIT_S):
                raise OutputError(
                    f"{folder} is still being written by workers of an earlier command: "
                    "try again when they have ended"
                )
            workers.truncate(0)
            workers.write(uuid.uuid4().hex)
        try:
            yield
        finally:
            if idle(folder, wait_s=0.0):  # else the next writer has to wait for them
                (folder / WORKERS).unlink(missing_ok=True)
            (folder / LOCK).unlink(missing_ok=True)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the writer's lock; on a new file where its last holder has just removed the old one."""
    path = folder / LOCK
    while True:
        with _opened(path) as held:
            if not _got(held, fcntl.LOCK_EX, 0.0):
                raise OutputError(f"{folder} is being written by another process")
            if _same(held, path):
                yield
                return


def _opened(path: Path, mode: str = "a") -> IO[str]:
    """Itself, not what it links to; ``OutputError`` for a second name of somebody's file."""
    file = open(  # noqa: SIM115 (whoever asked closes it)
        path,
        mode,
        encoding="ascii",
        opener=lambda name, how: os.open(name, how | UNFOLLOWED, 0o666),
    )
    if os.fstat(file.fileno()).st_nlink > 1:
        file.close()
        raise OutputError(f"{path} is another name of a file elsewhere: move it away")
    return file


def _same(held: IO[str], path: Path) -> bool:
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(held.fileno()), path.stat())
    return False


def _got(file: IO[str], kind: int, wait_s: float) -> bool:
    """Whether the lock was had in that time."""
    deadline = time.monotonic() + wait_s
    while True:
        with suppress(BlockingIOError):
            fcntl.flock(file, kind | fcntl.LOCK_NB)
            return True
        if time.monotonic() >= deadline:
            return False
        time.sleep(_AGAIN_S)


def ticket(folder: Path) -> str:
    """What the workers of the present writer are to show; "" where ``folder`` is not locked."""
    with suppress(FileNotFoundError), _opened(folder / WORKERS, "r") as workers:
        return workers.read()
    return ""


@contextmanager
def working(folder: Path, shown: str) -> Iterator[None]:
    """In a worker: no other writer takes ``folder`` up until the job is done.

    Raises ``OutputError`` when one has, or the folder cannot be locked.
    """
    with ExitStack() as stack:
        own = ""
        try:
            file = stack.enter_context(_opened(folder / WORKERS, "r"))
            if _got(file, fcntl.LOCK_SH, WAIT_S):
                own = file.read()
        except FileNotFoundError:
            pass
        except OSError as error:
            raise OutputError(f"cannot lock {folder}: {error.strerror or error}") from error
        if own != shown:
            raise OutputError(f"{folder} has been taken up by another command")
        yield


def idle(folder: Path, wait_s: float = WAIT_S) -> bool:
    """Wait until no worker has a job in ``folder``; False when one still has after ``wait_s``."""
    with suppress(FileNotFoundError), _opened(folder / WORKERS) as workers:
        return _got(workers, fcntl.LOCK_EX, wait_s)
    return True
