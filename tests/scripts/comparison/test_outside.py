# SPDX-License-Identifier: Apache-2.0
"""A comparison scores what SLAMs from outside do to it, and goes on."""

import json
import math
import mmap
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from scripts import imports
from scripts.comparison.entry import Entry, PeakMemory
from scripts.comparison.plan import Plan
from scripts.imports import source_of
from scripts.jobs import _digest
from slam.guests import Limits
from tests.scripts.comparison.hand_made import recording
from tests.slam.guests import misbehaving

pytestmark = pytest.mark.slow
CLIENT = Path(misbehaving.__file__)


def scored(fault: str, *, scan_s: float = 5.0, first_s: float = 10.0) -> dict[str, object]:
    drive = recording([(2.0, 1.0)] * 8)
    command = f"pipe:{sys.executable} -S -E {CLIENT} {fault}"
    entry = Entry(command, drive, Limits(scan_s=scan_s, first_s=first_s))
    entry.over([frame.without_truth() for frame in drive.frames])
    row: dict[str, object] = json.loads(entry.arrays()["row"])
    return row


def test_one_that_cannot_start_has_lost_at_once():
    row = scored("mute", first_s=0.3)
    assert (row["outcome"], row["scans"], row["lost_at_s"]) == ("hung", 0, 0.0)


OWN = {
    "own_package/__init__.py": "",
    "own_package/system.py": "from . import maths\nfrom .deep.er import more\nimport own_helper\n",
    "own_package/maths.py": "import numpy, os.path",
    "own_package/deep/__init__.py": "from .. import constants",
    "own_package/deep/er.py": "def more():\n    from own_package import late\n",
    "own_package/constants.py": "not Python",
    "own_package/late.py": "from .system import System",  # and round again
    "own_package/other.py": "",
    "own_helper.py": "import own_package.nowhere",
    "own_module.py": "from own_helper import *",
}


@pytest.fixture(params=["own"])
def own(tmp_path: Path, monkeypatch, request) -> Iterator[Path]:
    """A package of one's own beside a module of one's own, each with what it imports."""
    folder = tmp_path / request.param
    for name, text in OWN.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    monkeypatch.syspath_prepend(folder)
    yield folder
    sys.modules.pop("own_package", None)


def test_what_it_imports_from_beside_it_counts(own: Path):
    within = {p.relative_to(own).as_posix() for p in source_of("own_package.system:System")}
    whole = {p.relative_to(own).as_posix() for p in own.rglob("*.py")}
    assert within == whole - {"own_package/other.py", "own_module.py"}
    assert source_of("shunting") == ()
    assert source_of("tests.slam.guests.misbehaving:Any") == (CLIENT,)
    alone = ("own_helper.py", "own_module.py", "own_package/__init__.py")
    assert source_of("own_module:System") == tuple(own / name for name in alone)
    for same in (f"pipe:python3 {own / 'own_module.py'} --fast", "oracle(own_module:System)"):
        assert source_of(same) == source_of("own_module:System")


@pytest.mark.parametrize("own", ["site-packages"], indirect=True)
def test_of_what_is_installed_only_its_package_counts(own: Path):
    within = {p.relative_to(own).as_posix() for p in source_of("own_package.system:System")}
    assert "own_package/maths.py" in within
    assert "own_helper.py" not in within


def files_of(plan: Plan) -> tuple[dict[str, str], dict[str, str]]:
    """File names of the runs, and of the SLAMs on them."""
    _digest.cache_clear()
    runs = {name: job.file_name() for name, job in plan.recordings().items()}
    return runs, {slam: job.file_name() for _, slam, job in plan.entries()}


@pytest.mark.parametrize(
    ("slam", "scene", "given", "file", "remade"),
    [
        ("own_module:System", "arena", (), "own_helper.py", (False, True)),
        ("odometry", "arena", ("own_module",), "own_helper.py", (True, True)),
        ("odometry", "own_module:room", (), "own_helper.py", (True, True)),
        ("odometry", "own_module:room", (), "room.xml", (True, True)),
        ("odometry", "arena", (), "own_helper.py", (False, False)),
    ],
)
def test_after_a_change_in_code_of_ones_own_what_depends_on_it_is_made_again(
    own: Path, monkeypatch, slam, scene, given, file, remade
):
    """Recordings, and SLAMs on them: a SLAM, what ``--with`` loads, a scene or its plan."""
    monkeypatch.setattr(imports, "loaded", lambda: given)
    plan = Plan(slams=(slam,), scenes=(scene,), levels=(0.0,), seeds=(1,))
    before = files_of(plan)
    assert files_of(plan) == before
    (own / file).write_text("")
    assert tuple(a != b for a, b in zip(files_of(plan), before, strict=True)) == remade


def test_a_good_one_is_charged_its_own_time_and_memory():
    row = scored("none")
    assert row["failure"] is None
    assert row["scans"] == 8
    assert float(str(row["ms_per_scan_p50"])) > 0.0
    if sys.platform == "linux":
        assert 0.0 <= float(str(row["peak_memory_mb"])) < 100.0


MB = 1_000_000


def hold_for_a_moment(mb: int) -> None:
    """Straight from the system: what ``malloc`` gets, it may keep."""
    with mmap.mmap(-1, mb * MB) as pages:
        np.frombuffer(pages, dtype=np.uint8)[:] = 1


@pytest.mark.parametrize(("before_mb", "within_mb"), [(1, 80), (80, 8)])
def test_what_an_update_holds_counts_even_for_a_moment_and_nothing_else(before_mb, within_mb):
    memory = PeakMemory()
    hold_for_a_moment(before_mb)
    memory.begin()
    hold_for_a_moment(within_mb)
    memory.end()
    if math.isnan(memory.growth_bytes()):
        pytest.skip("the kernel does not say")
    assert memory.growth_bytes() / MB == pytest.approx(within_mb, abs=20.0)
