# SPDX-License-Identifier: Apache-2.0
"""A program behind ``pipe:`` gets no truth, however it tries, where the kernel can keep it off."""

import ctypes
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.comparison.entry import whole_result
from slam.errors import InvalidValueError, SlamFailedError
from slam.guests import Limits, limited
from slam.guests.confined import (
    EVERYTHING,
    LISTED,
    MORE,
    READ,
    WHOLE,
    WRITTEN,
    kernel_version,
    rules,
)
from slam.guests.pipe import PipeSlam
from slam.guests.wire import Wire
from tests.slam.guests import misbehaving

pytestmark = pytest.mark.skipif(not kernel_version(), reason="the kernel has no Landlock")

CHEAT, TRUTH = Path(__file__).with_name("cheating.py"), b"the truth: 1.25 -3.5 0.75"


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """In a folder of results, which lies in the folder of the guest."""
    path = tmp_path / "results" / "recordings" / "of one run.npz"
    path.parent.mkdir(parents=True)
    path.write_bytes(TRUTH)
    (tmp_path / "cheating.py").write_bytes(CHEAT.read_bytes())
    return path


def attempts(secret: Path, *, confined: bool) -> dict[str, str]:
    """What each of them got."""
    memory = ctypes.create_string_buffer(TRUTH)
    with open(secret, "rb") as held:
        command = [
            sys.executable, "-S", "-E", str(secret.parents[2] / "cheating.py"), str(secret),
            str(os.getpid()), str(ctypes.addressof(memory)), str(held.fileno()),
        ]  # fmt: skip
        other = subprocess.Popen(["tail", "-f", str(secret)], stdout=subprocess.DEVNULL)
        try:
            seen = rules(command, os.environ, [secret.parents[1]]) if confined else None
            slam = Wire(command, rules=seen)
            got: dict[str, str] = json.loads(json.loads(slam.ask(b"hello\n", 60.0))["message"])
            slam.close()
        finally:
            other.kill()
            other.wait()
    return got


def test_no_attempt_gets_the_truth_or_changes_it(secret: Path):
    got = attempts(secret, confined=True)
    assert len(got) == len(cheating_attempts()) >= 20
    if os.geteuid() == 0:  # a superuser may read them; no truth is in them
        got.pop("environments")
    if kernel_version() < WHOLE:
        got.pop("emptied_results")
    assert {name: said for name, said in got.items() if said} == {}
    assert secret.read_bytes() == TRUTH


def test_most_attempts_get_it_from_who_is_not_confined(secret: Path):
    """Else the attempts would prove nothing."""
    got = attempts(secret, confined=False)
    seen = [name for name, said in got.items() if TRUTH[:9].decode() in said]
    assert {"known_path", "argument_lists", "copied_by_a_program", "all_files"} <= set(seen)
    assert len(seen) >= 12, got
    assert got["five_hundred_at_random"].startswith(("4", "5")), got  # nearly all of them


def cheating_attempts() -> list[str]:
    return [line for line in CHEAT.read_text().splitlines() if line == "@attempt"]


def test_a_comparison_hides_its_folder_from_its_guests(secret: Path):
    """Whose file is named in the command, even."""
    script = secret.parents[2] / "cheating.py"
    name = f"pipe:{sys.executable} -S -E {script} '{secret}' {os.getpid()} 0 0"
    with pytest.raises(SlamFailedError) as failure:
        limited(name, Limits(hidden=(secret.parents[1],)))
    assert '"known_path": ""' in str(failure.value).replace("\\", "")


def test_it_has_a_temporary_folder_of_its_own_which_goes_with_it():
    said = "import os; t = os.environ['TMPDIR']; os.makedirs(t + '/a/b'); open(t + '/a/c', 'w'); "
    more = "os.symlink('/etc', t + '/a/d'); print(t, flush=True); input()"
    command = [sys.executable, "-S", "-E", "-c", said + more]
    wire = Wire(command, rules=rules(command, os.environ))
    folder = Path(os.fsdecode(wire.ask(b"", 20.0)))
    assert sorted(path.name for path in folder.rglob("*")) == ["a", "b", "c", "d"]
    wire.close()
    assert not folder.exists()
    assert Path("/etc/passwd").exists()


def test_what_it_may_see(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    for name in ("out", "mine/results", "mine/lib", "given", "more"):
        Path(name).mkdir(parents=True)
    Path("mine/slam.sh").touch()
    environment = {"PATH": "/usr/bin", "MY_PATH": str(tmp_path / "given"), MORE: "more"}
    found = rules(["sh", "mine/slam.sh"], environment, [Path("mine/results")])
    assert found is not None
    of_ours = {Path(p).relative_to(tmp_path).as_posix(): may for p, may in found
               if Path(p).is_relative_to(tmp_path)}  # fmt: skip
    assert of_ours == {
        "more": WRITTEN, "given": READ, "mine": LISTED, "mine/slam.sh": READ, "mine/lib": READ,
    }  # fmt: skip


def test_folders_that_are_not_there_are_told_and_all_is_all():
    with pytest.raises(InvalidValueError, match="folders that exist, got '/nowhere'"):
        rules(["sh"], {MORE: "/nowhere"})
    assert rules(["sh"], {MORE: EVERYTHING}) is None


@pytest.mark.parametrize("program", ["python3", sys.executable])
def test_a_module_in_the_working_folder_is_found(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Though Python itself may lie where the guest sees nothing: a PATH of the system's alone."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_slam.py").write_text("print('here', flush=True); input()")
    command = [program, "-m", "my_slam"]
    environment = {"PATH": "/usr/local/bin:/usr/bin:/bin", "TMPDIR": "/nowhere"}
    wire = Wire(command, environment, rules=rules(command, environment))
    assert wire.ask(b"", 20.0) == b"here"
    wire.close()


def test_a_track_of_a_benchmark_hides_the_others(tmp_path: Path):
    (tmp_path / "bench" / "no-walls").mkdir(parents=True)
    assert whole_result(tmp_path / "bench" / "no-walls") == tmp_path / "bench" / "no-walls"
    (tmp_path / "bench" / "recipe.json").touch()
    assert whole_result(tmp_path / "bench" / "no-walls") == tmp_path / "bench"


def test_a_good_guest_notices_nothing():
    command = [sys.executable, "-S", "-E", str(misbehaving.__file__), "none"]
    assert PipeSlam(command).map() is None
