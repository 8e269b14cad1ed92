# SPDX-License-Identifier: Apache-2.0
"""A SLAM behind the pipe that looks for the truth before its hello. Not a test.

Its arguments are the file with the truth, which none should know, and the process that reads it.
Each attempt answers with what it got hold of, or raises ``OSError``. All are told in one error.
"""

import contextlib
import ctypes
import json
import mmap
import os
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

C = ctypes.CDLL(None, use_errno=True)
SECRET, PARENT = Path(sys.argv[1]), int(sys.argv[2])
FOLDER = SECRET.parent
MINE = Path(os.environ.get("TMPDIR", "/tmp"))
PROC = Path(f"/proc/{PARENT}")
ATTEMPTS: list[Callable[[], bytes]] = []


def attempt(do: Callable[[], bytes]) -> Callable[[], bytes]:
    ATTEMPTS.append(do)
    return do


def called(*arguments: object) -> int:
    done: int = C.syscall(*arguments)
    if done < 0:
        raise OSError(ctypes.get_errno(), "syscall")
    return done


def shell(line: str) -> bytes:
    done = subprocess.run(["sh", "-c", line], capture_output=True, timeout=20, check=False)
    return done.stdout


@attempt
def known_path() -> bytes:
    return SECRET.read_bytes()


@attempt
def relative_path() -> bytes:
    return Path(os.path.relpath(SECRET)).read_bytes()


@attempt
def descriptor_of_its_folder() -> bytes:
    folder = os.open(FOLDER, os.O_PATH)
    return os.read(os.open(SECRET.name, os.O_RDONLY, dir_fd=folder), 99)


@attempt
def argument_lists() -> bytes:
    for line in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            for word in line.read_bytes().split(b"\0"):
                with contextlib.suppress(OSError):
                    if os.fsdecode(word) == str(SECRET) and line.parent.name != str(os.getpid()):
                        return Path(os.fsdecode(word)).read_bytes()
    return b""


@attempt
def environments() -> bytes:
    return (PROC / "environ").read_bytes()


@attempt
def memory() -> bytes:
    for line in (PROC / "maps").read_text().splitlines():
        if " rw-p " in line:
            with open(PROC / "mem", "rb") as it:
                it.seek(int(line.partition("-")[0], 16))
                return it.read(64)
    return b""


@attempt
def memory_by_system_call() -> bytes:
    there = ctypes.create_string_buffer(64)
    own = (ctypes.c_size_t * 2)(ctypes.addressof(there), 64)
    its = (ctypes.c_size_t * 2)(int(sys.argv[3]), 64)
    if C.process_vm_readv(PARENT, own, 1, its, 1, 0) < 0:
        raise OSError(ctypes.get_errno(), "process_vm_readv")
    return there.raw


@attempt
def debugger() -> bytes:
    if C.ptrace(0x4206, PARENT, None, None) < 0:  # seize: it does not stop
        raise OSError(ctypes.get_errno(), "ptrace")
    return b"seized"


@attempt
def its_descriptors() -> bytes:
    got = b""
    for path in (PROC / "fd").iterdir():
        with contextlib.suppress(OSError):
            got += os.read(os.open(path, os.O_RDONLY | os.O_NONBLOCK), 99)
    return got


@attempt
def descriptor_by_system_call() -> bytes:
    process = os.pidfd_open(PARENT)
    return os.pread(called(438, process, int(sys.argv[4]), 0), 99, 0)


@attempt
def its_root() -> bytes:
    return Path(f"{PROC}/root{SECRET}").read_bytes()


@attempt
def its_working_folder() -> bytes:
    return b"".join(name.name.encode() for name in (PROC / "cwd").iterdir())


@attempt
def inherited_descriptors() -> bytes:
    got = b""
    for number in range(3, 256):
        with contextlib.suppress(OSError):
            got += os.pread(number, 99, 0)
    return got


@attempt
def hard_link() -> bytes:
    os.link(SECRET, MINE / "linked")
    return (MINE / "linked").read_bytes()


@attempt
def symbolic_link() -> bytes:
    (MINE / "symbolic").symlink_to(SECRET)
    return (MINE / "symbolic").read_bytes()


@attempt
def copied_by_a_program() -> bytes:
    return shell(f"cp '{SECRET}' '{MINE}/copy' && cat '{MINE}/copy'")


@attempt
def mounted_elsewhere() -> bytes:
    mount = f"mkdir '{MINE}/seen'; mount --bind '{FOLDER}' '{MINE}/seen'"
    return shell(f"unshare -Urm sh -c \"{mount}; cat '{MINE}/seen/{SECRET.name}'\"")


@attempt
def namespaces_of_the_parent() -> bytes:
    return shell(f"nsenter -t {PARENT} -m -p cat '{SECRET}'")


@attempt
def handle_of_the_file() -> bytes:
    handle = ctypes.create_string_buffer(8 + 128)
    ctypes.memmove(handle, (128).to_bytes(4, sys.byteorder), 4)
    mount = ctypes.c_int()
    called(303, -100, bytes(SECRET), handle, ctypes.byref(mount), 0)
    return os.read(called(304, os.open("/", os.O_RDONLY), handle, 0), 99)


@attempt
def who_outlives_it() -> bytes:
    late = MINE / "late"
    return shell(f"(setsid sh -c \"cat '{SECRET}' > '{late}'\" &); sleep .3; cat '{late}'")


@attempt
def temporary_folders() -> bytes:
    return b"".join(path.name.encode() for path in Path("/tmp").iterdir())


@attempt
def all_files() -> bytes:
    above = FOLDER.parents[2]
    return shell(f"find '{above}' -name '{SECRET.name}' -type f -exec cat {{}} + 2>/dev/null")


def spelled(chance: random.Random) -> str:
    """The path in other words: detours, links of ``/proc``, from elsewhere."""
    start = chance.choice(["", "", "/proc/self/root", "/proc/thread-self/root", f"{PROC}/root"])
    words: list[str] = []
    for word in FOLDER.parts[1:]:
        words += [word, *chance.choices([[], ["."], [""], ["..", word]], [4, 1, 1, 1])[0]]
    text = "/".join([start, *words, SECRET.name])
    return os.path.relpath(text) if not start and chance.random() < 0.3 else text


def read_by(how: str, path: str) -> bytes:
    """Ways to read a file, or to change it."""
    if how == "link":
        copy = MINE / f"l{random.getrandbits(60)}"
        os.link(path, copy)
        return copy.read_bytes()
    if how == "in its folder":
        folder = os.open(os.path.dirname(path), os.O_PATH)
        return os.read(os.open(os.path.basename(path), os.O_RDONLY, dir_fd=folder), 99)
    flags = {"path": os.O_PATH, "write": os.O_RDWR, "append": os.O_WRONLY | os.O_APPEND}
    number = os.open(path, flags.get(how, os.O_RDONLY))
    try:
        if how == "path":  # may be had without a right; to open it again may not
            return Path(f"/proc/self/fd/{number}").read_bytes()
        if how == "map":
            return mmap.mmap(number, 0, prot=mmap.PROT_READ)[:99]
        if how == "send":
            with open(MINE / "sent", "w+b") as out:
                os.sendfile(out.fileno(), number, 0, 99)
                out.seek(0)
                return out.read()
        return b"opened" if how == "append" else os.pread(number, 99, 0)
    finally:
        os.close(number)


@attempt
def five_hundred_at_random() -> bytes:
    chance, got = random.Random(26), []
    ways = ("read", "path", "write", "append", "map", "send", "link", "in its folder")
    for _ in range(500):
        with contextlib.suppress(OSError):
            got.append(read_by(chance.choice(ways), spelled(chance)))
    return b"%d times: " % len(got) + b"".join(got) if got else b""


@attempt
def moved_file() -> bytes:
    os.rename(SECRET, MINE / "moved")
    return (MINE / "moved").read_bytes()


@attempt
def moved_folder() -> bytes:
    os.rename(FOLDER, MINE / "folder")
    return (MINE / "folder" / SECRET.name).read_bytes()


@attempt
def change_of_the_results() -> bytes:
    SECRET.write_bytes(SECRET.name.encode())
    return b"written"


@attempt
def emptied_results() -> bytes:
    os.truncate(SECRET, 0)
    return b"emptied"


@attempt
def change_of_the_code() -> bytes:
    with open(Path(__file__), "ab"):
        return b"can be written"


def main() -> None:
    sys.stdin.readline()
    got = {}
    for do in ATTEMPTS:
        try:
            got[do.__name__] = do().decode("latin-1")[:99]
        except (OSError, subprocess.SubprocessError):
            got[do.__name__] = ""
    print(json.dumps({"type": "error", "message": json.dumps(got)}), flush=True)


if __name__ == "__main__":
    main()
