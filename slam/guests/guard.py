# SPDX-License-Identifier: Apache-2.0
"""The process that ends what a mobilia has started when that asks for it, or dies.

``wire`` runs this file as a script of its own, with nothing but the standard library:
``python -I -S guard.py DESCRIPTOR PARENT MARK UNSET COMMAND...``. The end of that socket, or the
death of ``PARENT``, is its order to kill.

It is the parent of the guest ``COMMAND``, which has its streams and environment, without the
variable ``UNSET`` that Python adds. Over the socket it says "pid N" or "errno N", later "exited N"
or "signal N". On Linux the kernel gives it every orphan below it ("child subreaper"), so that
processes in sessions of their own, daemons too, stay its descendants and are found. The guest
itself dies with the guard, should that be killed. Elsewhere only the guest's process group is
killed.

With a ``MARK`` and no command it kills the processes whose environment has that, "name=value"
(Linux). Worker processes get one: one that is still being loaded has had no time to tie itself to
its parent.
"""

import ctypes
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import partial

KILL_LIMIT_S = 3.0  # then it gives up: a process of another user, or one stuck in the kernel
_AGAIN_S = 0.005
_QUIET_S = 0.3  # without a marked one: a process between fork and exec shows no mark
_PDEATHSIG, _CHILD_SUBREAPER = 1, 36  # linux/prctl.h
_LINUX = sys.platform == "linux"
Found = dict[int, int]  # numbers of processes, and when each was started (clock ticks)


def main(words: list[str]) -> None:
    """Start the guest, wait for the order, kill."""
    control, parent, mark = int(words[0]), int(words[1]), words[2]
    os.set_inheritable(control, False)
    _prctl(_CHILD_SUBREAPER, 1)
    guest = 0
    if command := words[4:]:
        os.environ.pop(words[3], None)
        try:
            tie = partial(_tie, os.getpid())
            child = subprocess.Popen(command, start_new_session=True, preexec_fn=tie)
        except (OSError, subprocess.SubprocessError) as error:
            _say(control, "errno", getattr(error, "errno", 1))
            return
        guest = child.pid
    woken = _wake_up()
    _say(control, "pid", guest)
    nothing = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):  # the guest's now
        os.dup2(nothing, number)
    _wait(control, woken, parent, guest)
    _kill(guest, os.fsencode(mark))


def _tie(guard: int) -> None:
    """In the guest, before it is the command: it ends with the guard."""
    _prctl(_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != guard:
        os._exit(1)


def _prctl(option: int, value: int) -> None:
    if _LINUX:
        ctypes.CDLL(None).prctl(option, ctypes.c_ulong(value), 0, 0, 0)


def _say(control: int, word: str, number: int) -> None:
    with suppress(OSError):  # it has gone: the next look at the socket shows it
        os.write(control, b"%s %d\n" % (word.encode(), number))


def _wake_up() -> int:
    """Readable whenever a child or the parent has ended; what else is sent means nothing."""
    woken, wake = os.pipe()
    for number in (woken, wake):
        os.set_blocking(number, False)
    for order in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGQUIT):
        signal.signal(order, signal.SIG_IGN)  # mobilia hears them too, and decides
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    # Should a fork of mobilia's hold the other end of the socket open. It comes when the thread
    # that started the guard ends as well: hence the look at the parent.
    _prctl(_PDEATHSIG, signal.SIGCHLD)
    return woken


def _wait(control: int, woken: int, parent: int, guest: int) -> None:
    """Until the order comes; says meanwhile how the guest ended and reaps its orphans."""
    poll = select.poll()
    poll.register(control, select.POLLIN)
    poll.register(woken, select.POLLIN)
    alive = guest > 0
    while os.getppid() == parent:
        alive = alive and _look(control, guest)
        for descriptor, _ in poll.poll():
            if descriptor == control:
                return
            os.read(woken, 4096)


def _look(control: int, guest: int) -> bool:
    """Whether the guest lives. Dead it is left unreaped: its number stays its own."""
    while info := os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        if info.si_pid == guest:
            word = "exited" if info.si_code == os.CLD_EXITED else "signal"
            _say(control, word, info.si_status)
            return False
        os.waitpid(info.si_pid, 0)
    return True


def _kill(guest: int, mark: bytes) -> None:
    """The guest's group, then all descendants, or all with the mark, until there are none."""
    if guest:
        with suppress(OSError):  # before it is reaped and the number another's
            os.killpg(guest, signal.SIGKILL)
    seen = time.monotonic()
    deadline = seen + KILL_LIMIT_S
    while time.monotonic() < deadline:
        stopped: Found = {}
        while new := {p: at for p, at in _found(mark).items() if p not in stopped}:
            for pid, born in new.items():
                _send(pid, born, signal.SIGSTOP)  # none forks while the others are killed
            stopped |= new
            if time.monotonic() > deadline:
                break
        for pid, born in stopped.items():
            _send(pid, born, signal.SIGKILL)
        with suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        seen = time.monotonic() if stopped else seen
        if not stopped and (not mark or time.monotonic() > seen + _QUIET_S):
            return
        time.sleep(_AGAIN_S)


def _found(mark: bytes) -> Found:
    """All processes with the mark, or all below this one."""
    if mark:
        return {pid: born for pid, (_, born) in _processes() if _has(pid, mark)}
    children: dict[int, Found] = {}
    for pid, (parent, born) in _processes():
        children.setdefault(parent, {})[pid] = born
    found = generation = children.get(os.getpid(), {})
    while generation:
        below: Found = {}
        for pid in generation:
            below |= children.get(pid, {})
        found, generation = found | below, below
    return found


def _processes() -> Iterator[tuple[int, tuple[int, int]]]:
    for entry in os.listdir("/proc") if _LINUX else ():
        if entry.isdigit() and (stat := _stat(int(entry))):
            yield int(entry), stat


def _has(pid: int, mark: bytes) -> bool:
    """But for trackers of shared memory, which clean up and end when their users have."""
    with suppress(OSError):
        with open(f"/proc/{pid}/environ", "rb") as environment:
            if mark not in environment.read().split(b"\0"):
                return False
        with open(f"/proc/{pid}/cmdline", "rb") as command:
            return b"resource_tracker" not in command.read()
    return False


def _stat(pid: int) -> tuple[int, int] | None:
    """Parent and time of start of a process, None where it has gone."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            fields = file.read().rpartition(b")")[2].split()
    except OSError:
        return None
    return int(fields[1]), int(fields[19])


def _send(pid: int, born: int, number: int) -> None:
    """The signal to that very process and to none that got its number since."""
    stat = _stat(pid)
    if stat is not None and stat[1] == born:
        with suppress(OSError):
            os.kill(pid, number)


if __name__ == "__main__":
    main(sys.argv[1:])
