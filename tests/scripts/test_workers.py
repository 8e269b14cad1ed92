# SPDX-License-Identifier: Apache-2.0
"""Worker processes end with the command, and no command takes up a folder that they still write."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from scripts import workers
from scripts.jobs import Job, run_jobs
from slam import locks
from slam.errors import MobiliaError
from slam.guests.wire import Wire
from tests.processes import processes_with, python

pytestmark = pytest.mark.slow
REPO = Path(__file__).resolve().parents[2]
MARK = "MOBILIA_TEST_WORKERS"


def never_ends(path: Path, *, guest: bool) -> None:
    """A job that starts what a job may start and never comes to an end."""
    if guest:
        wire = Wire(["sh", "-c", "setsid sleep 300 & echo 1; sleep 300"])
        wire.ask(b"", 10.0)
    path.with_suffix(f".{os.getpid()}.begun").touch()
    while True:
        sum(range(1_000_000))


def quick(path: Path, *, guest: bool) -> None:
    path.write_text(str(guest))


def some_jobs(call=never_ends, guest: bool = True) -> list[Job]:
    return [Job(name=f"j{k}", call=call, arguments={"guest": guest}) for k in range(2)]


def begin(folder: Path, mark: str) -> subprocess.Popen[bytes]:
    """``run_jobs`` in a process of its own, up to where both workers are at work."""
    code = (
        "from pathlib import Path; from scripts.jobs import run_jobs\n"
        "from tests.scripts.test_workers import some_jobs\n"
        f"run_jobs(some_jobs(), Path({str(folder)!r}), processes=2)"
    )
    environment = {**os.environ, "PYTHONPATH": str(REPO), MARK: mark}
    command = subprocess.Popen([sys.executable, "-c", code], cwd=REPO, env=environment)
    deadline = time.monotonic() + 60.0
    while len(list(folder.glob(".*.begun"))) < 2:
        assert time.monotonic() < deadline
        assert command.poll() is None
        time.sleep(0.02)
    return command


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_workers_and_their_guests_end_with_a_killed_command(tmp_path):
    command = begin(tmp_path, "killed")
    assert (
        len(processes_with(MARK, "killed")) >= 11
    )  # the command, 2 workers, 2 guests, their children, guards
    command.kill()
    command.wait()
    killed = time.monotonic()
    while left := processes_with(MARK, "killed"):
        assert time.monotonic() - killed < 10.0, left
        time.sleep(0.01)
    print(f"the last process ended {time.monotonic() - killed:.2f} s after the kill")
    for begun in tmp_path.glob(".*.begun"):
        begun.unlink()
    files = run_jobs(some_jobs(quick), tmp_path, processes=2)
    assert sorted(path.name for path in tmp_path.glob("*.npz")) == sorted(
        path.name for path in files.values()
    )


def kill_a_worker(folder: Path) -> None:
    while not (begun := list(folder.glob(".*.begun"))):
        time.sleep(0.02)
    os.kill(int(begun[0].suffixes[-2][1:]), signal.SIGKILL)


def test_a_killed_worker_is_one_line(tmp_path):
    killer = threading.Thread(target=kill_a_worker, args=(tmp_path,))
    killer.start()
    with pytest.raises(MobiliaError, match=r"a worker process was killed, .* goes on from here"):
        run_jobs(some_jobs(guest=False), tmp_path, processes=2)
    killer.join()


def holds(folder: Path) -> bool:
    return locks.idle(folder, wait_s=0.0)


def test_jobs_hold_on_to_a_locked_folder(tmp_path):
    with locks.locked(tmp_path):
        found = list(workers.each(holds, [tmp_path] * 2, jobs=2, shared=tmp_path))
    assert found == [False, False]
    assert list(workers.each(holds, [tmp_path] * 2, jobs=2, shared=tmp_path)) == [True, True]


def test_what_the_tracker_of_semaphores_finds_left_over_goes_without_a_word():
    """It may lose a race against the end of the process; to the user that is no news."""
    code = (
        "from scripts.workers import each\n"
        "assert sorted(each(abs, [-1, 2], jobs=2)) == [1, 2]\n"
        "from joblib.externals.loky.backend import resource_tracker\n"
        "resource_tracker.register('/loky-1-nothing', 'semlock')\n"
    )
    done = python("-c", code)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def grows(item: int) -> int:
    """A job after which its worker is replaced: it seems to have grown."""
    from joblib.externals.loky import process_executor

    process_executor._MEMORY_LEAK_CHECK_DELAY = 0.0
    process_executor._MAX_MEMORY_LEAK_SIZE = -1e12
    return item


def test_a_worker_that_is_replaced_is_not_the_users_business():
    code = (
        "from scripts import workers; from tests.scripts.test_workers import grows\n"
        "assert sorted(workers.each(grows, range(8), jobs=2)) == list(range(8))\n"
        "import warnings; warnings.warn('another', UserWarning)"
    )
    done = python("-c", code)
    assert "A worker stopped" not in done.stderr
    assert "UserWarning: another" in done.stderr
