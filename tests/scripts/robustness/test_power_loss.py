# SPDX-License-Identifier: Apache-2.0
"""A power cut leaves each thing whole or absent: bytes are synced, then named, then the name is.

A file system keeps the bytes of a file once the file was synced, and a name once its folder was.
So the order of the calls is what is held here.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scripts.output import write_recipe
from scripts.whole_folder import whole_folder
from slam import files
from slam.maps import write_map
from slam.shunting import ShuntingSlam
from slam.system import Raster

pytestmark = pytest.mark.fuzz
Calls = list[tuple[str, str]]


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Calls:
    """Every fsync and rename below ``tmp_path`` in order: what, and of whom (or to which name)."""
    seen: Calls = []

    def told(what: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def telling(*of: Any) -> Any:
            path = os.readlink(f"/proc/self/fd/{of[0]}") if what == "sync" else str(of[1])
            seen.append((what, os.path.relpath(path, tmp_path).replace(f".{os.getpid()}", "")))
            return call(*of)

        return telling

    monkeypatch.setattr(os, "fsync", told("sync", os.fsync))
    monkeypatch.setattr(os, "replace", told("rename", os.replace))
    monkeypatch.setattr(files, "exchange", told("rename", files.exchange))
    return seen


def test_a_file_is_synced_then_named_then_its_name_is_synced(calls: Calls, tmp_path: Path):
    files.write_text(tmp_path / "b.txt", "text")
    assert calls == [("sync", ".b.part.txt"), ("rename", "b.txt"), ("sync", ".")]


@pytest.mark.parametrize("there", [False, True])
def test_a_folder_is_synced_whole_then_named(calls: Calls, tmp_path: Path, there: bool):
    for text in ("old", "new") if there else ("new",):
        calls.clear()
        with whole_folder(tmp_path / "run", overwrite=there) as part:
            files.write_text(part / "a.txt", text)
            write_recipe(part, "test", {})
    names = ["a.txt", "recipe.json", "SHA256SUMS"]
    at = calls.index(("rename", "run"))
    before = [name for what, name in calls[:at] if what == "sync"]
    assert sorted(before) == sorted([*(f".run.part/{name}" for name in names), ".run.part"])
    assert before[-1] == ".run.part"  # the names in it, after the bytes
    assert ("sync", ".") in calls[at:]
    assert (tmp_path / "run" / "a.txt").read_text() == "new"


def test_of_a_map_the_image_is_named_before_the_file_that_vouches_for_it(calls, tmp_path):
    values = np.full((3, 3), 0.5, dtype=np.float32)
    write_map(tmp_path / "map", Raster(values=values, resolution_m=0.1, T_map_origin=np.zeros(3)))
    renames = [name for what, name in calls if what == "rename"]
    assert renames == ["map.pgm", "map.yaml"]
    ShuntingSlam().save(tmp_path / "map.npz")
    assert [name for what, name in calls if what == "rename"][-1] == "map.npz"
    for name in ("map.pgm", "map.yaml", "map.npz"):
        at = calls.index(("rename", name))
        assert calls[at - 1][0] == "sync"
        assert ("sync", ".") in calls[at:]
