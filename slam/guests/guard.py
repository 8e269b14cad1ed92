# SPDX-License-Identifier: Apache-2.0
"""The process that ends what a mobilia has started when that asks for it, or dies.

``wire`` runs this file as a script of its own, with nothing but the standard library (10 MB,
some 10 ms): ``python -I -S guard.py DESCRIPTOR PARENT``. Over that socket it is told what to do.
The end of the socket, or the death of ``PARENT``, is its order to kill.

Told a command, it is the parent of that guest; it answers "pid N" or "errno N", later "exited N" or
"signal N". On Linux the kernel gives it every orphan below it ("child subreaper"), so that
processes in sessions of their own, daemons too, stay its descendants and are found. The guest
itself dies with the guard, should that be killed. Elsewhere only the guest's process group is
killed.

Where the kernel can (Landlock), the guest sees only the files that the command comes with, and has
a temporary folder of its own, which goes with it.

Told none, it kills the processes whose environment has its mark (Linux). Worker processes get that:
one that is still being loaded has had no time to tie itself to its parent.
"""

import ctypes
import errno
import marshal
import os
import select
import signal
import sys
import time
import warnings  # noqa: F401 (os.execvpe imports it, and Python's own folder may be hidden by then)
from contextlib import suppress

KILL_LIMIT_S = 3.0  # then it gives up: a process of another user, or one stuck in the kernel
_AGAIN_S = 0.005
_QUIET_S = 0.3
_PDEATHSIG, _CHILD_SUBREAPER = 1, 36  # linux/prctl.h
_LINUX = sys.platform == "linux"

# linux/landlock.h
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_BENEATH, _NO_NEW_PRIVILEGES = 1, 38  # the latter: linux/prctl.h
_RIGHTS = (0, 0x1FFF, 0x3FFF, 0x7FFF)  # all of an interface's version on files; later ones: devices
_OF_FILES = 0x4007  # of them, those that a file can have: execute, write, read, truncate
_MAY = (0x8, 0xD, 0x7FFF)  # list; list, read and execute; everything


def main(words: list[str]) -> None:
    """Start the guest, wait for the order, kill."""
    control, parent = int(words[0]), int(words[1])
    os.set_inheritable(control, False)
    told = _told(control)
    if told is None:
        return
    command, environment, mark, rules = told
    if not command:
        woken = _wake_up()
        _say(control, b"pid 0\n")
        _wait(control, woken, parent, 0)
        _kill_marked(mark)
        return
    _prctl(_CHILD_SUBREAPER, 1)
    own = b""
    if rules is not None:
        own = _own_folder(environment.get(b"TMPDIR", b""))
        if not own:
            _say(control, b"errno %d\n" % errno.EACCES)
            return
        environment[b"TMPDIR"] = own
        for name in (b"NUMBA_CACHE_DIR", b"XDG_CACHE_HOME"):  # it cannot write to the usual ones
            environment.setdefault(name, own)
        rules.append((own, 2))
    try:
        _guard(control, parent, command, environment, rules)
    finally:
        _remove(own)


def _guard(
    control: int,
    parent: int,
    command: list[bytes],
    environment: dict[bytes, bytes],
    rules: list[tuple[bytes, int]] | None,
) -> None:
    guest, error = _start(command, environment, rules)
    if error:
        _say(control, b"errno %d\n" % error)
        return
    woken = _wake_up()
    _say(control, b"pid %d\n" % guest)
    nothing = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):  # the guest's now
        os.dup2(nothing, number)
    _wait(control, woken, parent, guest)
    _kill(guest)


def _own_folder(wanted: bytes) -> bytes:
    """A new one for temporary files, b"" where none can be made."""
    for place in (wanted, b"/tmp", b"/var/tmp"):
        folder = os.path.join(place, b"mobilia-guest-" + os.urandom(8).hex().encode())
        with suppress(OSError):
            if os.path.isabs(place):
                os.mkdir(folder, 0o700)
                return os.path.realpath(folder)
    return b""


def _remove(folder: bytes) -> None:
    """The guest's own: it has gone."""
    if folder:
        import shutil  # it takes time to load, of which nobody waits for a guest here

        shutil.rmtree(folder, ignore_errors=True)


def _confine(rules: list[tuple[bytes, int]]) -> None:
    """This process, and what it starts, may touch no file but those; raises ``OSError``."""
    call = ctypes.CDLL(None, use_errno=True).syscall

    def asked(*arguments: object) -> int:
        done = int(call(*arguments))
        if done < 0:
            raise OSError(ctypes.get_errno(), "Landlock")
        return done

    handled = _RIGHTS[min(asked(_CREATE_RULESET, None, 0, 1), len(_RIGHTS) - 1)]
    wanted = handled.to_bytes(8, sys.byteorder)
    ruleset = asked(_CREATE_RULESET, wanted, len(wanted), 0)
    for path, may in rules:
        with suppress(FileNotFoundError, PermissionError):  # gone, or not ours: not the guest's
            place = os.open(path, os.O_PATH)
            rights = handled & _MAY[may] & (-1 if os.path.isdir(path) else _OF_FILES)
            rule = rights.to_bytes(8, sys.byteorder) + place.to_bytes(4, sys.byteorder)
            if rights:
                asked(_ADD_RULE, ruleset, _BENEATH, rule, 0)
            os.close(place)
    _prctl(_NO_NEW_PRIVILEGES, 1)
    asked(_RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)


def _prctl(option: int, value: int) -> None:
    if _LINUX:
        ctypes.CDLL(None).prctl(option, ctypes.c_ulong(value), 0, 0, 0)


def _told(
    control: int,
) -> tuple[list[bytes], dict[bytes, bytes], bytes, list[tuple[bytes, int]] | None] | None:
    """Command, environment, mark and rules, None when mobilia has gone before it said them."""
    heard = b""
    while len(heard) < 8 or len(heard) < 8 + int.from_bytes(heard[:8], "little"):
        data = os.read(control, 1 << 16)
        if not data:
            return None
        heard += data
    command, environment, mark, rules = marshal.loads(heard[8:])  # from mobilia itself
    return command, environment, mark, rules


def _say(control: int, words: bytes) -> None:
    with suppress(OSError):  # it has gone: the next look at the socket shows it
        os.write(control, words)


def _start(
    command: list[bytes], environment: dict[bytes, bytes], rules: list[tuple[bytes, int]] | None
) -> tuple[int, int]:
    """The guest in a session of its own: its number, and why it could not be started, or 0."""
    guard = os.getpid()
    read, write = os.pipe()
    guest = os.fork()
    if guest == 0:
        try:
            os.setsid()
            _prctl(_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != guard:
                os._exit(1)
            for number in (signal.SIGPIPE, signal.SIGXFSZ):  # which Python ignores
                signal.signal(number, signal.SIG_DFL)
            if rules is not None:
                _confine(rules)
            os.execvpe(command[0], command, environment)
        except OSError as error:
            os.write(write, b"%d" % (error.errno or 1))
        finally:
            os._exit(127)
    os.close(write)
    with open(read, "rb") as answer:
        return guest, int(answer.read() or b"0")


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
    while True:
        info = os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        if info is None:
            return True
        if info.si_pid == guest:
            word = b"exited" if info.si_code == os.CLD_EXITED else b"signal"
            _say(control, b"%s %d\n" % (word, info.si_status))
            return False
        os.waitpid(info.si_pid, 0)


def _kill(guest: int) -> None:
    """The guest's group, then all descendants, until there are none."""
    with suppress(OSError):  # before it is reaped and the number another's
        os.killpg(guest, signal.SIGKILL)
    deadline = time.monotonic() + KILL_LIMIT_S
    while time.monotonic() < deadline:
        stopped: dict[int, int] = {}
        while new := {pid: born for pid, born in _descendants().items() if pid not in stopped}:
            for pid, born in new.items():
                _send(pid, born, signal.SIGSTOP)  # none forks while the others are killed
            stopped |= new
            if time.monotonic() > deadline:
                break
        for pid, born in stopped.items():
            _send(pid, born, signal.SIGKILL)
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        time.sleep(_AGAIN_S)


def _kill_marked(mark: bytes) -> None:
    """Until none has been seen for a while: one between fork and exec shows no mark."""
    deadline = time.monotonic() + KILL_LIMIT_S
    seen = time.monotonic()
    while time.monotonic() < min(deadline, seen + _QUIET_S):
        for entry in os.listdir("/proc") if _LINUX else ():
            if entry.isdigit() and (stat := _stat(int(entry))) and _has(int(entry), mark):
                _send(int(entry), stat[1], signal.SIGKILL)
                seen = time.monotonic()
        time.sleep(_AGAIN_S)


def _has(pid: int, mark: bytes) -> bool:
    """But for trackers of shared memory, which clean up and end when their users have."""
    with suppress(OSError):
        with open(f"/proc/{pid}/environ", "rb") as environment:
            if mark not in environment.read().split(b"\0"):
                return False
        with open(f"/proc/{pid}/cmdline", "rb") as command:
            return b"resource_tracker" not in command.read()
    return False


def _descendants() -> dict[int, int]:
    """Numbers of all processes below this one, and when each was started (clock ticks)."""
    children: dict[int, list[tuple[int, int]]] = {}
    for entry in os.listdir("/proc") if _LINUX else ():
        if entry.isdigit() and (stat := _stat(int(entry))):
            children.setdefault(stat[0], []).append((int(entry), stat[1]))
    found: dict[int, int] = {}
    generation = [os.getpid()]
    while generation:
        born = [child for pid in generation for child in children.get(pid, ())]
        found.update(born)
        generation = [pid for pid, _ in born]
    return found


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
    handle = -1
    with suppress(OSError, AttributeError):  # Linux before 5.3: the look alone must do
        handle = os.pidfd_open(pid)
    stat = _stat(pid)
    with suppress(OSError):
        if stat is not None and stat[1] == born:
            if handle >= 0:
                signal.pidfd_send_signal(handle, number)
            else:
                os.kill(pid, number)
    if handle >= 0:
        os.close(handle)


if __name__ == "__main__":
    main(sys.argv[1:])
