# SPDX-License-Identifier: Apache-2.0
"""Where a step of an environment goes: ``python -m scripts.benches.shares PICTURE.png PAGE.md``.

Linux's ``perf`` looks where the processor is, some thousand times; a picture and the place
``shares`` of the page show it by parts.
"""

import argparse
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import gymnasium
from matplotlib.figure import Figure
from numba.core.codegen import CPUCodeLibrary

from scripts import marks
from scripts.benches.world import SEED, ceiling, stepping
from scripts.figures import save, styled
from scripts.machine import machine
from slam.errors import MissingDependencyError

STEPS = 4000
ROOMS = ("Arena", "Office")
PARTS = {  # by the file that the code is in, and its name; the first that fits
    "MuJoCo": r"libmujoco",
    "people, doors, chairs": r"sim5world8substeps|sim6actors|sim4core",
    "scan": r"sim7sensors5lidar",
    "odometry": r"sim7sensors8odometry",
    "references counted": r"NRT_",
    "sin, cos, … of all": r"libm\.",
    "Python, NumPy": r"",
}
COLOURS = ("#59616e", "#ce2c3c", "#1f61be", "#0b8c96", "#8c6d1f", "#7a3fb0", "#de6e18")
_compiled: list[tuple[CPUCodeLibrary, bytes]] = []


def note_kernels() -> None:
    """From now on keep what Numba compiles or loads, to know its names."""
    take = CPUCodeLibrary._set_compiled_object

    def kept(library: CPUCodeLibrary, code: bytes) -> None:
        _compiled.append((library, code))
        take(library, code)

    CPUCodeLibrary._set_compiled_object = kept


def name_kernels() -> Path:
    """Tell ``perf`` the names of compiled kernels, where it looks for them."""
    lines = []
    for library, code in _compiled:
        with tempfile.NamedTemporaryFile(suffix=".o") as file:
            file.write(code)
            file.flush()
            listed = subprocess.run(["nm", "-S", file.name], capture_output=True, check=True)
        found = re.findall(r"^(\w+) (\w+) [tTwW] (\S+)$", listed.stdout.decode(), re.MULTILINE)
        where = library.codegen._engine._ee.get_function_address
        # The entry from Python is in one file only, other kernels may be in several.
        entries = [(at, name) for at, _, name in found if name.startswith("_ZN7cpython")]
        for base in [where(name) - int(at, 16) for at, name in entries[:1]]:
            lines += [f"{base + int(at, 16):x} {size} {name}\n" for at, size, name in found]
    path = Path(f"/tmp/perf-{os.getpid()}.map")
    path.write_text("".join(lines), encoding="utf-8")
    return path


def shares(room: Any, steps: int) -> dict[str, float]:
    """us of a step by ``PARTS``."""
    stepping(room, 500, 1)  # all that is done now and then, so that it is compiled
    with tempfile.TemporaryDirectory() as scratch:
        samples = Path(scratch) / "samples"
        words = ["perf", "record", "-q", "-e", "cpu-clock:u", "-F", "1999", "-o", str(samples)]
        perf = subprocess.Popen([*words, "-p", str(os.getpid())])
        time.sleep(1.0)
        step_us = stepping(room, steps // 8, 1) / (steps // 8) * 1e6
        perf.send_signal(signal.SIGINT)
        perf.wait()
        names = name_kernels()
        told = subprocess.run(
            ["perf", "report", "-i", str(samples), "--stdio", "--sort", "dso,sym"],
            capture_output=True, check=True,
        ).stdout.decode()  # fmt: skip
        names.unlink()
    spent = dict.fromkeys(PARTS, 0.0)
    for percent, where in re.findall(r"^ +([\d.]+)% +(.*)$", told, re.MULTILINE):
        part = next(name for name, those in PARTS.items() if re.search(those, where))
        spent[part] += float(percent)
    return {part: step_us * share / sum(spent.values()) for part, share in spent.items()}


@styled({"axes.grid": False})
def picture(found: dict[str, dict[str, float]], path: Path) -> None:
    """A bar a room."""
    figure = Figure(figsize=(8.0, 1.9))
    ax = figure.subplots()
    ends = dict.fromkeys(found, 0.0)
    for part, colour in zip(PARTS, COLOURS, strict=True):
        widths = [parts[part] for parts in found.values()]
        ax.barh(list(found), widths, left=list(ends.values()), color=colour, label=part)
        ends = {room: ends[room] + parts[part] for room, parts in found.items()}
    ax.set_xlabel("processor time of a step of one scan, every effect, µs")
    figure.legend(loc="outside upper center", ncols=4, frameon=False)
    save(figure, path)


def main(path: Path, page: Path) -> None:
    """Measure, draw, and fill the page."""
    if shutil.which("perf") is None:
        raise MissingDependencyError("perf is not there: it comes with the tools of the kernel")
    note_kernels()
    found, lines = {}, ["| part of a step, µs | " + " | ".join(ROOMS) + " |", "|---|---:|---:|"]
    alone = {}
    for name in ROOMS:
        env: Any = gymnasium.make(f"mobilia/{name}-v2", disable_env_checker=True, time_limit_s=1e6)
        env.reset(seed=SEED)
        found[name] = shares(env.unwrapped, STEPS)
        alone[name] = 1e6 / ceiling(env.unwrapped.simulation.world)["figure"]
    for part in PARTS:
        lines.append(f"| {part} | " + " | ".join(f"{found[r][part]:.0f}" for r in ROOMS) + " |")
    whole = {name: sum(parts.values()) for name, parts in found.items()}
    lines.append("| all | " + " | ".join(f"{whole[r]:.0f}" for r in ROOMS) + " |")
    rate = " | ".join(f"{alone[r] / whole[r]:.0%}" for r in ROOMS)
    lines.append(f"| rate, of that of `mj_step` alone | {rate} |")
    told = "\n".join([*lines, "", f"Seed {SEED}, {machine()['processor']}."])
    marks.fill_page(page, "shares", told)
    picture(found, path)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", type=Path)
    parser.add_argument("page", type=Path)
    asked = parser.parse_args()
    main(asked.picture, asked.page)
