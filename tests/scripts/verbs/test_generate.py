# SPDX-License-Identifier: Apache-2.0
"""A dataset ends with the same bytes however it was made; every fault is one clear line."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import typer

from scripts.spec import command
from scripts.verbs.generate import Generate
from scripts.verbs.verify import Verify
from sim.recording.dataset import Plan, check_dataset, read_plan, writing
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from sim.recording.sums import SUMS, write_sums
from sim.recording.verify import regenerate
from slam.errors import LogFormatError, OutputError
from slam.logs import read_bag
from tests.processes import python

pytestmark = pytest.mark.slow
generate, verify = command(Generate), command(Verify)

REPO = Path(__file__).resolve().parents[3]
SETTINGS = {"episodes": 3, "seconds": 1.5, "seed": 1}
NAMES = [f"arena-d0.5-s000{k}" for k in (1, 2, 3)]


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(REPO), "COLUMNS": "200", **more}


def in_background(out: Path, *options: str, seconds: float = 1.5) -> subprocess.Popen[str]:
    command = ["generate", "arena", "--episodes", "3", "--seed", "1", "--out", out, *options]
    return subprocess.Popen(
        [sys.executable, "-m", "scripts", *map(str, command), "--seconds", str(seconds)],
        cwd=REPO, env=environment(), start_new_session=True, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip


def wait_for(there: Callable[[], object]) -> None:
    for _ in range(18_000):
        if there():
            return
        time.sleep(0.01)
    raise AssertionError("nothing happened for three minutes")


def whole_episodes(out: Path) -> list[Path]:
    return sorted(out.glob("arena-*"))


@pytest.fixture(scope="module")
def serial(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("serial") / "data"
    generate(["arena"], out, **SETTINGS)
    return out


def flip(path: Path, at: float = 0.5) -> None:
    data = bytearray(path.read_bytes())
    data[int(at * len(data))] ^= 0x40
    path.write_bytes(bytes(data))


def test_killed_in_mid_episode_and_started_again_ends_with_the_same_bytes(serial, tmp_path):
    out = tmp_path / "data"
    code = (  # which stops in the second episode, to be killed there
        "import time; from pathlib import Path; from scripts.verbs.generate import Generate\n"
        "from sim.recording.bag import BagWriter\n"
        "write, stamps = BagWriter.write, []\n"
        "def writes(bag, moment):\n"
        "    stamps.append(moment.frame.stamp_ns)\n"
        "    time.sleep(300.0 if stamps.count(stamps[0]) == 2 and len(stamps) % 10 == 0 else 0.0)\n"
        "    write(bag, moment)\n"
        "BagWriter.write = writes\n"
        f"Generate(scene=['arena'], out=Path({str(out)!r}), **{SETTINGS})()"
    )
    child = subprocess.Popen([sys.executable, "-c", code], env=environment())
    wait_for(lambda: whole_episodes(out) and list(out.glob(".*.part/*/*.mcap")))
    child.kill()
    child.wait()
    assert not (out / SUMS).exists()
    first = whole_episodes(out)[0]
    kept = (first / RECIPE).stat()
    generate(["arena"], out, **SETTINGS)
    assert (out / SUMS).read_bytes() == (serial / SUMS).read_bytes()
    assert (first / RECIPE).stat().st_mtime_ns == kept.st_mtime_ns  # not made again
    assert {p.name for p in out.iterdir()} == {*NAMES, SUMS, "dataset.json", "index.html"}
    done = subprocess.run(["sha256sum", "-c", "--quiet", SUMS], cwd=out, check=False)
    assert done.returncode == 0


def test_ctrl_c_leaves_whole_episodes_and_nothing_else(tmp_path):
    out = tmp_path / "data"
    running = in_background(out, "--jobs", "2", seconds=30.0)
    wait_for(lambda: list(out.glob(".*.part/*/*.mcap")))
    os.killpg(running.pid, signal.SIGINT)
    printed, _ = running.communicate(timeout=180)
    assert running.returncode == 130, printed
    assert "interrupted" in printed
    assert {p.name for p in out.iterdir()} <= {*NAMES, "dataset.json"}


def test_numpy_without_its_vector_units_makes_the_same_messages(serial, tmp_path):
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    if not found:
        pytest.skip("this NumPy names no vector units to turn off")
    code = (
        "import sys; from pathlib import Path\n"
        "from sim.recording.episode import record\n"
        "from sim.recording.recipe import made_with, read_recipe\n"
        f"made = read_recipe(Path({str(serial / NAMES[0] / RECIPE)!r}))\n"
        "again = record(made.recipe, Path(sys.argv[1]))\n"
        "print(again[made.recipe.name]['messages_sha256'], made_with()['cpu'] or 'none')\n"
    )
    done = python("-c", code, tmp_path, NPY_DISABLE_CPU_FEATURES=" ".join(found))
    digest, cpu = done.stdout.split()[:2]
    made = read_recipe(serial / NAMES[0] / RECIPE)
    assert digest == made.result["messages_sha256"]
    assert cpu == "none"


def rewritten(folder: Path, change: Callable[[dict], None]) -> Path:
    """The episode with another recipe.json, hashes made good."""
    recipe = json.loads((folder / RECIPE).read_text())
    change(recipe)
    (folder / RECIPE).write_text(json.dumps(recipe))
    write_sums(folder)
    return folder


def test_what_another_machine_made_differs_but_is_not_called_damaged(serial, tmp_path):
    def elsewhere(recipe: dict) -> None:
        recipe["made_with"]["versions"]["mujoco"] = "3.0.0"
        recipe["made_with"]["cpu"] = "AVX512F"
        recipe["result"]["messages_sha256"] = "0" * 64

    def unexplained(recipe: dict) -> None:
        recipe["result"]["messages_sha256"] = "0" * 64

    def repacked(recipe: dict) -> None:
        recipe["made_with"]["versions"]["rosbags"] = "0.1"

    folder = shutil.copytree(serial / NAMES[0], tmp_path / "a" / NAMES[0])
    finding = regenerate(rewritten(folder, elsewhere))
    assert (finding.verdict, finding.ok) == ("differs", True)
    assert "other CPU or version: cpu AVX512F then" in finding.why
    assert "mujoco 3.0.0 then" in finding.why
    folder = shutil.copytree(serial / NAMES[0], tmp_path / "b" / NAMES[0])
    finding = regenerate(rewritten(folder, unexplained))
    assert (finding.verdict, finding.ok) == ("differs", False)
    folder = shutil.copytree(serial / NAMES[0], tmp_path / "c" / NAMES[0])
    assert regenerate(rewritten(folder, repacked)).verdict == "same messages"


def test_a_flipped_bit_is_found_named_and_mended(serial, tmp_path, capsys):
    out = shutil.copytree(serial, tmp_path / "data")
    flip(out / NAMES[1] / f"{NAMES[1]}.mcap")
    with pytest.raises(typer.Exit):
        verify(out)
    printed = capsys.readouterr()
    assert f"{NAMES[1]}.mcap is damaged" in (printed.out + printed.err).replace("\n", "")
    with pytest.raises(LogFormatError, match=NAMES[1]):
        list(read_bag(out / NAMES[1], labels=True))
    generate(["arena"], out, **SETTINGS)
    assert (out / SUMS).read_bytes() == (serial / SUMS).read_bytes()
    verify(out)


def test_two_writers_another_plan_and_foreign_files_are_refused(serial, tmp_path):
    plan = Plan(
        recipe=Recipe(scene="arena", seed=0, dynamism=0.5, seconds=1.0),
        dynamisms=(0.5,),
        episodes=1,
    )
    with (
        writing(tmp_path / "a", plan),
        pytest.raises(OutputError, match="another process"),
        writing(tmp_path / "a", plan),
    ):
        pass
    before = (serial / SUMS).read_bytes()
    with pytest.raises(OutputError, match="another dataset"):
        generate(["arena"], serial, **{**SETTINGS, "seed": 9})
    assert (serial / SUMS).read_bytes() == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match="no dataset"):
        generate(["arena"], tmp_path / "mine", **SETTINGS)
    with pytest.raises(OutputError, match=r"thesis\.tex"):
        generate(["arena"], tmp_path / "mine" / "thesis.tex", **SETTINGS)
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.tex"]


def test_twins_share_path_and_odometry_and_differ_in_what_moves(tmp_path):
    out = tmp_path / "data"
    generate(["arena"], out, episodes=1, seconds=2.0, seed=2, dynamism=["1"], twins=True)
    frames = {
        name: list(read_bag(out / f"arena-d1-s0002-{name}"))
        for name in ("dynamic", "semi_static", "static")
    }
    for a, b, c in zip(*frames.values(), strict=True):
        assert a.odometry == b.odometry == c.odometry
        assert np.array_equal(a.truth, b.truth)
        assert np.array_equal(a.truth, c.truth)
    moving = [
        read_recipe(out / f"arena-d1-s0002-{name}" / RECIPE).result["returns"]["moving"]
        for name in ("dynamic", "static")
    ]
    assert moving[0] > moving[1] == 0
    assert regenerate(out / "arena-d1-s0002-static").verdict == "same bytes"


def test_one_command_makes_parts_of_several_scenes(tmp_path):
    out = tmp_path / "data"
    options = {"seconds": 0.2, "seed": 5, "split": "train:2,test:1", "twins": True}
    generate(["arena", "corridor"], out, **options)
    listed = {name: (out / f"{name}.txt").read_text().split() for name in ("train", "test")}
    folders = sorted(path.parent.name for path in out.glob("*/recipe.json"))
    assert sorted(listed["train"] + listed["test"]) == folders
    assert len(folders) == 2 * 3 * 3  # scenes, seeds, twins
    seeds = {part: {name.split("-s")[1][:4] for name in names} for part, names in listed.items()}
    assert seeds == {"train": {"0005", "0006"}, "test": {"0007"}}
    assert all({name.split("-")[0] for name in names} == {"arena", "corridor"}
               for names in listed.values())  # fmt: skip
    assert read_plan(out).split == (("train", 2), ("test", 1))
    assert all(finding.ok for finding in check_dataset(out))
    first = (out / SUMS).read_bytes()
    shutil.rmtree(out / listed["test"][0])
    generate(["arena", "corridor"], out, **options)
    assert (out / SUMS).read_bytes() == first
    (out / "test.txt").write_text("arena-d0.5-s0005\n")
    assert not all(finding.ok for finding in check_dataset(out))


def test_each_episode_is_also_in_another_format(serial, tmp_path):
    out = tmp_path / "data"
    words = {"episodes": 1, "seconds": 0.2, "format": "npz"}
    generate(["arena"], out, **words)
    (episode,) = whole_episodes(out)
    with np.load(episode / f"{episode.name}.npz") as arrays:
        ranges = [frame.scan.ranges for frame in read_bag(episode)]
        np.testing.assert_array_equal(arrays["ranges"], ranges)
    assert all(finding.ok for finding in check_dataset(out))
    assert regenerate(episode).verdict == "same bytes"
    with pytest.raises(OutputError, match="another dataset"):
        generate(["arena"], out, **{**words, "format": "mcap"})
    flip(episode / f"{episode.name}.npz")
    assert not all(finding.ok for finding in check_dataset(out))


def kill_in_mid_episode(worker: subprocess.Popen[bytes], out: Path) -> None:
    wait_for(lambda: list(out.glob(f".*.{worker.pid}.part/*/*.mcap")))
    worker.kill()


@contextmanager
def dask_cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The address of a scheduler; its process, and those of two workers."""
    distributed = pytest.importorskip("distributed")
    told = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def start(part: str, *options: object) -> subprocess.Popen[bytes]:
        words = [sys.executable, "-m", f"distributed.cli.dask_{part}", "--scheduler-file", told]
        words += ["--host", "127.0.0.1", "--no-dashboard", *options]
        return subprocess.Popen([str(w) for w in words], cwd=REPO, env=environment(), **quiet)

    worker = ("--nthreads", 1, "--no-nanny", "--local-directory", folder)
    parts = [start("scheduler", "--port", 0), start("worker", *worker), start("worker", *worker)]
    try:
        wait_for(lambda: told.exists() and told.read_text().endswith("}"))
        address = json.loads(told.read_text())["address"]
        with distributed.Client(address) as client:
            client.wait_for_workers(2, timeout=60)
        yield address, parts
    finally:
        for part in reversed(parts):
            part.terminate()
            part.wait(timeout=20)


def test_a_dask_cluster_that_loses_a_worker_makes_the_same_bytes(serial, tmp_path):
    out = tmp_path / "data"
    with dask_cluster(tmp_path) as (address, parts):
        killer = threading.Thread(target=kill_in_mid_episode, args=(parts[1], out))
        killer.start()
        generate(["arena"], out, **SETTINGS, cluster=address)
        killer.join()
        assert parts[1].poll() == -signal.SIGKILL
    assert (out / SUMS).read_bytes() == (serial / SUMS).read_bytes()


def test_a_scheduler_of_dask_that_dies_is_one_line_and_the_command_goes_on(tmp_path):
    words = ["generate", "arena", "--seconds", "8", "--episodes", "6"]
    command = [sys.executable, "-m", "scripts", *words, "--out", str(tmp_path / "out")]
    with dask_cluster(tmp_path) as (address, parts):
        begun = subprocess.Popen(
            [*command, "--cluster", address], cwd=REPO, env=environment(), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        wait_for(lambda: list((tmp_path / "out").glob(f"**/.*.{parts[1].pid}.part*")))
        parts[0].kill()
        printed, said = begun.communicate(timeout=180)
        assert begun.returncode == 1
        assert said.count("\n") == 1
        assert "has gone; with another one, the same command again goes on from here" in said
        assert "Traceback" not in printed
    done = subprocess.run(command, cwd=REPO, env=environment(), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
