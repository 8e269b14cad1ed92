# SPDX-License-Identifier: Apache-2.0
"""Our arena beside the closest scene of ir-sim, 30 movers each, in one run.

``python -m scripts.experiments.compare_irsim [--python PATH]``: ir-sim is no dependency of this
project. Give
the interpreter of any environment that has it (``pip install ir-sim``); by default this one.

Alike: a room of 10 x 8 m, four walls, 30 round movers, a differential robot turning at the same
twist, 361 exact ranges over 180 degrees each 26.7 ms of simulated time, no picture, one core.

Not alike, and why the ratio is no verdict: ir-sim moves discs kinematically, at whatever velocity a
behaviour gives (RVO here, and straight dashes without avoidance); nothing has mass, a mover that
is hit is a collision flag. Ours are chairs and walkers with mass, friction and contacts, eight
physics steps a scan, people on two legs, and beams cast from the pose at each beam's own time.
ir-sim in turn is a teaching and learning tool with planners, behaviours and any polygon from a few
lines of YAML; its obstacles are Shapely geometries, one Python object each.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import gymnasium
import numpy as np

import sim  # noqa: F401  (registers the environments)
from sim.sensors.lidar.models.lms221 import Lms221Config

MOVERS, STEPS = 30, 100
SCENE = """
world: {{height: 8, width: 10, step_time: 0.02667, sample_time: 0.02667,
         collision_mode: 'unobstructed'}}
robot:
  - kinematics: {{name: 'diff'}}
    shape: {{name: 'circle', radius: 0.25}}
    state: [5, 4, 0]
    sensors:
      - {{type: 'lidar2d', range_min: 0, range_max: 80, angle_range: 3.14159265, number: 361}}
obstacle:
  - shape: {{name: 'linestring', vertices: [[0, 0], [10, 0], [10, 8], [0, 8], [0, 0]]}}
    state: [0, 0, 0]
  - number: {movers}
    distribution: {{name: 'random', range_low: [1, 1, -3.14], range_high: [9, 7, 3.14]}}
    kinematics: {{name: 'omni'}}
    behavior: {{name: '{behavior}', wander: True, range_low: [1, 1, -3.14],
                range_high: [9, 7, 3.14], vxmax: 0.8, vymax: 0.8}}
    shape: {{name: 'circle', radius: 0.2}}
"""
OTHER = """
import json, sys, time
import numpy as np, irsim
env = irsim.make(sys.argv[1], display=False, disable_all_plot=True, log_level="ERROR")
action, steps = np.array([[0.1], [0.4]]), int(sys.argv[2])
for _ in range(5):
    env.step(action)
began = time.process_time()
for _ in range(steps):
    env.step(action)
    ranges = env.get_lidar_scan()["ranges"]
each = (time.process_time() - began) / steps
print(json.dumps({"us": 1e6 * each, "beams": len(ranges), "version": irsim.__version__}))
"""


def ours(chairs: int, people: int, share: float) -> float:
    """CPU s of one step of the arena."""
    env = gymnasium.make(
        "mobilia/Arena-v2", disable_env_checker=True, laser=Lms221Config.ideal(), time_limit_s=1e6
    )
    action = np.array([0.1 / 0.8, 0.4 / 1.2], np.float32)
    env.reset(
        seed=1,
        options={
            "n_chairs": chairs, "n_people": people, "dynamism": 1.0,
            "moving_share": share, "goal": None,
        },
    )  # fmt: skip
    for _ in range(50):
        env.step(action)
    began = time.process_time()
    for _ in range(3 * STEPS):
        env.step(action)
    return (time.process_time() - began) / (3 * STEPS)


def theirs(python: str, behavior: str) -> dict[str, float | str]:
    """CPU us of one step of ir-sim with movers of that behaviour."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.yaml"
        scene.write_text(SCENE.format(movers=MOVERS, behavior=behavior), encoding="utf-8")
        done = subprocess.run(
            [python, "-c", OTHER, str(scene), str(STEPS)],
            capture_output=True,
            text=True,
            cwd=folder,
            check=False,
        )
    if done.returncode != 0:
        why = done.stderr.strip().splitlines()[-1] if done.stderr.strip() else "no message"
        raise SystemExit(
            f"ir-sim does not run in {python}: {why}\n"
            "Make an environment that has it (python -m venv X; X/bin/pip install ir-sim) and give "
            "its interpreter: python -m scripts.experiments.compare_irsim --python X/bin/python"
        )
    result: dict[str, float | str] = json.loads(done.stdout.strip().splitlines()[-1])
    return result


def main() -> None:
    """Measure both, print one table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--python", default=sys.executable, help="interpreter that has ir-sim")
    python = parser.parse_args().python
    rows: list[tuple[str, float]] = []
    for behavior in ("dash", "rvo"):
        result = theirs(python, behavior)
        name = f"ir-sim {result['version']}, {MOVERS} discs, behaviour {behavior}"
        rows.append((name, float(result["us"])))
    for name, chairs, people, share in (
        (f"mobilia arena, {MOVERS} chairs, all rolling", MOVERS, 0, 1.0),
        (f"mobilia arena, {MOVERS - 6} chairs rolling, 6 people", MOVERS - 6, 6, 1.0),
    ):
        rows.append((name, 1e6 * ours(chairs, people, share)))
    print(
        f"{'one step = one scan of 361 beams, 26.7 ms simulated':55s}{'us CPU':>9s}{'steps/s':>9s}"
    )
    for name, us in rows:
        print(f"{name:55s}{us:9.0f}{1e6 / us:9.0f}")
    print((__doc__ or "").partition("Alike:")[2].join(("\nAlike:", "")))


if __name__ == "__main__":
    main()
