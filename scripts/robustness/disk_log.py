# SPDX-License-Identifier: Apache-2.0
"""What a command does to the disk, step by step, and what a power cut after any step leaves there.

log = DiskLog(folder)
with log.recording():
    command(folder)
log.left(step, Cut.NAMES)      # name -> bytes, None for a folder

The model is a file system that keeps no more than it must. Bytes are on the disk when their file
was synced, names when their folder was. Whatever else had happened may be there or not.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from slam import files

State = dict[str, bytes | None]
_WRITES = os.O_WRONLY | os.O_RDWR
_EVENTS = ("open", "os.mkdir", "os.remove", "os.rmdir", "os.rename", "os.link")
_listening: list[DiskLog] = []


class Cut(Enum):
    """What is left of names that were not synced: none, all, or some. Bytes not synced are lost."""

    NOTHING = "nothing unsynced"
    NAMES = "all names, no bytes"
    SOME = "some names, some bytes"


@dataclass(frozen=True, kw_only=True)
class Names:
    """One step on names: (folder, name) -> node or None, all at once."""

    entries: dict[tuple[int, str], int | None]


@dataclass(frozen=True, kw_only=True)
class Opened:
    """A file that is there was opened to be written; ``emptied`` or not."""

    node: int
    emptied: bool


@dataclass(frozen=True, kw_only=True)
class Synced:
    """A file with its bytes, or a folder (None)."""

    node: int
    data: bytes | None


@dataclass(eq=False)
class DiskLog:
    """Steps below ``root``, which is there.

    exchange  whether the file system can swap two names at once
    """

    root: Path
    exchange: bool = True
    steps: list[Names | Opened | Synced] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.root = self.root.resolve()
        self._folders: dict[int, dict[str, int]] = {0: {}}  # as the command sees them
        self._started: dict[int, bytes] = {}
        self._nodes = 1
        self._take_in(self.root, 0)
        self._at_first = {node: dict(names) for node, names in self._folders.items()}

    def _take_in(self, folder: Path, node: int) -> None:
        for path in sorted(folder.iterdir()):
            own = self._folders[node][path.name] = self._new()
            if path.is_dir():
                self._folders[own] = {}
                self._take_in(path, own)
            else:
                self._started[own] = path.read_bytes()

    def _new(self) -> int:
        self._nodes += 1
        return self._nodes - 1

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Log what this process does in the block."""
        _listen()
        sync, swap = os.fsync, files.exchange

        def fsync(number: int) -> None:
            sync(number)
            self._synced(Path(os.readlink(f"/proc/self/fd/{number}")))

        def exchange(first: Path, second: Path) -> bool:
            if not self.exchange or not swap(first, second):
                return False
            (one, a), (two, b) = (self._place(self._path(p, -1)) for p in (first, second))
            nodes = self._folders[one][a], self._folders[two][b]
            self._names({(one, a): nodes[1], (two, b): nodes[0]})
            return True

        _listening.append(self)
        try:
            with mock.patch("os.fsync", fsync), mock.patch("scripts.output.exchange", exchange):
                yield
        finally:
            _listening.remove(self)

    def happens(self, event: str, args: tuple[Any, ...]) -> None:
        """Of the interpreter, before it does it."""
        if event == "open":
            self._opens(args[0], args[2])
        elif event == "os.mkdir":
            path = self._path(args[0], args[2])
            if self._below(path) and path.parent.is_dir() and not path.exists():
                node = self._new()
                self._folders[node] = {}
                self._names({self._place(path): node})
        elif event in ("os.remove", "os.rmdir"):
            path = self._path(args[0], args[1])
            gone = os.path.lexists(path) and not (event == "os.rmdir" and os.listdir(path))
            if self._below(path) and gone:
                self._names({self._place(path): None})
        elif event == "os.link":
            old, new = self._path(args[0], args[2]), self._path(args[1], args[3])
            if self._below(new) and old.exists() and not new.exists():
                folder, name = self._place(old)
                self._names({self._place(new): self._folders[folder][name]})
        elif event == "os.rename":
            old, new = self._path(args[0], args[2]), self._path(args[1], args[3])
            if self._below(old) and self._below(new) and old.exists():
                folder, name = self._place(old)
                node = self._folders[folder][name]
                self._names({(folder, name): None, self._place(new): node})

    def _opens(self, opened: Any, flags: int) -> None:
        if isinstance(opened, int) or not flags & _WRITES:
            return
        path = self._path(opened, -1)
        if not self._below(path) or not path.parent.is_dir():
            return
        if not path.exists():
            if flags & os.O_CREAT:
                self._names({self._place(path): self._new()})
            return
        folder, name = self._place(path)
        node = self._folders[folder][name]
        self.steps.append(Opened(node=node, emptied=bool(flags & os.O_TRUNC)))

    def _synced(self, path: Path) -> None:
        if path == self.root:
            node = 0
        elif self._below(path):
            folder, name = self._place(path)
            node = self._folders[folder][name]
        else:
            return
        if path.is_dir() and set(os.listdir(path)) != set(self._folders[node]):
            raise AssertionError(f"{path}: something was made that was not noticed")
        self.steps.append(Synced(node=node, data=None if path.is_dir() else path.read_bytes()))

    def _names(self, entries: dict[tuple[int, str], int | None]) -> None:
        _apply(self._folders, entries)
        self.steps.append(Names(entries=entries))

    def _path(self, path: Any, folder_number: int) -> Path:
        base = Path.cwd() if folder_number == -1 else Path(f"/proc/self/fd/{folder_number}")
        whole = base.resolve() / os.fsdecode(path)
        return whole.parent.resolve() / whole.name

    def _below(self, path: Path) -> bool:
        return self.root in path.parents

    def _place(self, path: Path) -> tuple[int, str]:
        node = 0
        for name in path.absolute().relative_to(self.root).parts[:-1]:
            node = self._folders[node][name]
        return node, path.name

    def left(self, step: int, cut: Cut, seed: int = 0) -> State:
        """What is on the disk when the power fails after ``step`` steps."""
        rng = np.random.default_rng((seed, step))
        done = self.steps[:step]
        folders = {node: dict(names) for node, names in self._at_first.items()}
        for k, names in enumerate(done):
            if not isinstance(names, Names):
                continue
            if self._lasts(k, names, step) or _kept(cut, rng):
                _apply(folders, names.entries)
        state: State = {}
        self._walk(folders, 0, "", state, step, rng if cut is Cut.SOME else None)
        return state

    def _lasts(self, k: int, names: Names, step: int) -> bool:
        """Whether a folder of that step was synced after it."""
        own = {folder for folder, _ in names.entries}
        return any(isinstance(s, Synced) and s.node in own for s in self.steps[k + 1 : step])

    def _walk(
        self,
        folders: dict[int, dict[str, int]],
        node: int,
        where: str,
        state: State,
        step: int,
        rng: np.random.Generator | None,
    ) -> None:
        for name, own in folders.get(node, {}).items():
            if own in self._folders:
                state[where + name] = None
                self._walk(folders, own, f"{where}{name}/", state, step, rng)
            else:
                state[where + name] = self._bytes(own, step, rng)

    def _bytes(self, node: int, step: int, rng: np.random.Generator | None) -> bytes:
        """Those synced last, if the file was not opened since; else none, or a part of them."""
        data, sound = self._started.get(node), node in self._started
        for s in self.steps[:step]:
            if isinstance(s, Synced) and s.node == node:
                data, sound = s.data, True
            elif isinstance(s, Opened) and s.node == node:
                sound = False
        if sound and data is not None:
            return data
        if rng is None:
            return b""
        whole = self._next(node, step) or data or b"?"
        return whole[: int(rng.integers(len(whole)))]

    def _next(self, node: int, step: int) -> bytes | None:
        later = (s for s in self.steps[step:] if isinstance(s, Synced) and s.node == node)
        return next((s.data for s in later), None)


def _kept(cut: Cut, rng: np.random.Generator) -> bool:
    return cut is Cut.NAMES or (cut is Cut.SOME and bool(rng.integers(2)))


def _apply(folders: dict[int, dict[str, int]], entries: dict[tuple[int, str], int | None]) -> None:
    for (folder, name), node in entries.items():
        names = folders.setdefault(folder, {})
        if node is None:
            names.pop(name, None)
        else:
            names[name] = node


def _listen() -> None:
    """Once for a process: the interpreter's hooks cannot be taken back."""
    if not getattr(_listen, "done", False):
        sys.addaudithook(_heard)
        _listen.done = True  # type: ignore[attr-defined]


def _heard(event: str, args: tuple[Any, ...]) -> None:
    if _listening and event in _EVENTS:
        for log in tuple(_listening):
            log.happens(event, args)


def tree(folder: Path) -> State:
    """All that lies in a folder, as ``DiskLog.left`` tells it."""
    return {
        path.relative_to(folder).as_posix(): None if path.is_dir() else path.read_bytes()
        for path in sorted(folder.rglob("*"))
    }


def put_down(state: State, folder: Path) -> None:
    """Make ``folder`` hold what ``state`` says."""
    folder.mkdir(parents=True)
    for name, data in state.items():
        path = folder / name
        if data is None:
            path.mkdir(parents=True, exist_ok=True)
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
