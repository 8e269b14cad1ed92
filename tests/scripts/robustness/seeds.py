# SPDX-License-Identifier: Apache-2.0
"""Small sound files of every format: ``python -m tests.scripts.robustness.seeds`` makes them anew.

Each folder of ``corpus`` is one input: a file, or several that belong together.
"""

import gzip
import json
import lzma
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image
from rosbags.rosbag1 import Writer as WriterOfRos1
from rosbags.rosbag2 import StoragePlugin, Writer

from scripts.benchmark import runs_file
from sim.recording.dataset import Plan
from sim.recording.episode import record
from sim.recording.recipe import RECIPE, Recipe, read_recipe, write_recipe
from sim.sensors.lidar.registry import register
from sim.sensors.lidar.scanner import Scanner
from sim.simulation import Simulation
from slam.archives import write_arrays
from slam.files import write_text
from slam.logs import read_bag, write_carmen
from slam.logs.bag_topics import ROS1, ROS2, Bag
from slam.maps import write_map
from slam.shunting import ShuntingSlam
from slam.system import Raster
from slam.trajectory import Trajectory, write_tum
from tests.scenes.test_from_file import LAB
from tests.scenes.test_plan_file import SHED
from tests.scripts.benchmark.test_submission import made as submitted
from tests.scripts.report import made
from tests.slam.logs import test_bad_numbers as texts
from tests.slam.logs.test_rawlog import drive
from tests.slam.logs.test_rover import POSES, TICKS

CORPUS = Path(__file__).with_name("corpus")
PLAIN = ("robotlaser", "rawlaser", "reading", "parameters", "centimetre")
TOPICS = ("/scan", "/scan_turn", "/odom", "/tf_static", "/ground_truth/pose")
EVENTS = """
[[event]]
at_s = 0.5
push = ""
speed_mps = 1.0
[[event]]
at_s = 1
enter = 1
by = [2, 2]
"""
SPACE = (
    "[numbers]\nmatching.local.points = {low = 60, high = 360, int = true}\n"
    'objective = {choices = ["sum", "log"]}\n"matching.reward" = {low = 1, high = 9, log = true}\n'
)
ROBOT = (Path(__file__).parents[3] / "sim" / "robots" / "turtlebot3.toml").read_text()


def main() -> None:
    """Write them all."""
    shutil.rmtree(CORPUS, ignore_errors=True)
    for name, files in {**scenes(), **maps(), **logs(), **results()}.items():
        (CORPUS / name).mkdir(parents=True)
        for file, data in files.items():
            (CORPUS / name / file).write_bytes(data if isinstance(data, bytes) else data.encode())


def scenes() -> dict[str, dict[str, str | bytes]]:
    plan = SHED.replace(
        "</worldbody>",
        '<geom type="capsule" fromto="1 1 0 1 1 1" size="0.1" material="metal"/>'
        '<body name="post" pos="0 1 0.5"><geom type="cylinder" size="0.1 0.5"/></body>'
        '<site name="goal:a" pos="2 0 0"/><site name="put:bin" pos="1 -1 0"/>'
        '<site name="desk:0" pos="0 -1.5 0" euler="0 0 3.14"/><camera name="top" pos="0 0 9"/>'
        "</worldbody>",
    )
    named = 'plan = "shed.xml"\nrobot = "robot.toml"\nn_people = 1\n'
    things = 'things = [{ kind = "bin", at = [3, 3, 0], boxes = [[3, 3, 0.2, 0.2, 0]] }]\n'
    return {
        "plan": {"shed.xml": plan},
        "lab": {"lab.toml": LAB + things + EVENTS},
        "named": {"lab.toml": named + EVENTS, "shed.xml": plan, "robot.toml": ROBOT},
        "events": {"events.toml": EVENTS},
        "robot": {"robot.toml": ROBOT},
        "space": {"space.toml": SPACE},
    }


def maps() -> dict[str, dict[str, str | bytes]]:
    values = np.full((60, 80), np.nan, dtype=np.float32)
    values[5:55, 5:75], values[30, 20:60] = 0.0, 1.0
    values[[5, 54], 5:75], values[5:55, 5], values[5:55, 74] = 1.0, 1.0, 1.0
    raster = Raster(values=values, resolution_m=0.1, T_map_origin=np.array([-1.0, -2.0, 0.1]))
    folder = CORPUS / "made"
    folder.mkdir(parents=True)
    pgm, yaml = write_map(folder / "map", raster)
    text = "".join(line for line in yaml.open() if not line.startswith("#"))
    found = {"map": {"map.yaml": text, "map.pgm": pgm.read_bytes()}}
    fields = dict(line.strip().split(": ", 1) for line in text.splitlines())
    block = text.replace("[", "\n- ").replace(", ", "\n- ").replace("]", "")
    words = {"png": text, "bmp": block, "tif": json.dumps(fields, indent=1)}
    for kind, told in words.items():
        Image.open(pgm).save(folder / f"map.{kind}")
        image = {f"map.{kind}": (folder / f"map.{kind}").read_bytes()}
        found[kind] = {"map.yaml": told.replace(".pgm", f".{kind}"), **image}
    shutil.rmtree(folder)
    return found


@register("few")
def few() -> Scanner:
    """A scanner of few beams."""
    return Scanner(
        name="few", first_deg=-60.0, step_deg=10.0, n_beams=13, rate_hz=25.0, range_max_m=9.0
    )


def logs() -> dict[str, dict[str, str | bytes]]:
    folder = CORPUS / "made"
    recipe = Recipe(
        scene="arena",
        seed=1,
        dynamism=0.0,
        seconds=0.2,
        scanner="few:ideal",
        options={"n_chairs": 1},
    )
    folder.mkdir(parents=True)
    record(recipe, folder)
    episode = folder / recipe.name
    with Bag(episode) as bag:
        messages = list(bag.raw(TOPICS))
    kinds = {topic: kind for topic, kind, _, _ in messages}
    for plugin, name in ((StoragePlugin.MCAP, "plain"), (StoragePlugin.SQLITE3, "sqlite")):
        with Writer(folder / name, version=8, storage_plugin=plugin) as writer:
            made_ = {t: writer.add_connection(t, k, typestore=ROS2) for t, k in kinds.items()}
            for topic, _, stamp_ns, data in messages:
                writer.write(made_[topic], stamp_ns, data)
    with WriterOfRos1(folder / "a.bag") as old:
        connections = {t: old.add_connection(t, k, typestore=ROS1) for t, k in kinds.items()}
        for topic, kind, stamp_ns, data in messages:
            old.write(connections[topic], stamp_ns, bytes(ROS2.cdr_to_ros1(data, kind)))
    write_carmen(folder / "a.log", read_bag(episode))
    real = read_recipe(episode / RECIPE)
    write_recipe(folder / RECIPE, replace(real.recipe, scanner="ideal"), real.result)
    text = (folder / "a.log").read_bytes()
    sqlite, plain = folder / "sqlite", folder / "plain" / "plain.mcap"
    rows = {name: "".join(make()) for name, make in texts.ROWS.items()}
    found: dict[str, dict[str, str | bytes]] = {
        "carmen": {"a.log": text}, "gz": {"a.log.gz": gzip.compress(text, mtime=0)},
        "xz": {"a.log.xz": lzma.compress(text)},
        "packed": {"a.mcap": (episode / f"{episode.name}.mcap").read_bytes()},
        "mcap": {"a.mcap": plain.read_bytes()}, "ros1": {"a.bag": (folder / "a.bag").read_bytes()},
        "sqlite": {f.name: f.read_bytes() for f in sqlite.iterdir()},
        "rawlog": {"a.rawlog": b"".join(drive())},
        "ticks": {"a.csv": rows["ticks"], "a.toml": TICKS},
        "poses": {"a.csv": rows["poses"], "a.toml": POSES},
        "recipe": {RECIPE: (folder / RECIPE).read_bytes()},
        **{k: {"a.log": rows[k]} for k in PLAIN},
    }  # fmt: skip
    shutil.rmtree(folder)
    return found


def results() -> dict[str, dict[str, str | bytes]]:
    folder = CORPUS / "made"
    compared = made.make(folder / "compared", seeds=(100,))
    simulation = Simulation("arena", laser="few:ideal", dynamism=0.0, n_chairs=1)
    slam = ShuntingSlam()
    for _ in range(4):
        slam.update(simulation.observe().without_truth())
    slam.save(folder / "map.npz")
    with np.load(folder / "map.npz") as file:
        arrays = dict(file)
    words = json.loads(str(arrays["header"]))
    del words["sha256"]  # else damage is noticed by it alone
    with (folder / "map.npz").open("wb") as new:
        write_arrays(new, {**arrays, "header": np.array(json.dumps(words))})
    made_with = {"machine": {"processor": "an abacus", "cores": 2}}
    runs_file.write(folder / "mine.json", replace(submitted(), made_with=made_with))
    plan = Plan(
        recipe=Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.1),
        dynamisms=(0.5,),
        episodes=2,
    )
    write_text(folder / "dataset.json", plan.text())
    write_tum(folder / "a.tum", Trajectory(stamps_ns=np.arange(5) * 10**8, poses=np.eye(5, 3)))
    found: dict[str, dict[str, str | bytes]] = {
        "tables": {f.name: f.read_bytes() for f in compared.glob("*.csv")},
        "compared": {RECIPE: (compared / RECIPE).read_bytes()},
        "run": {"run.npz": next((compared / "runs").glob("*.npz")).read_bytes()},
        "state": {"a.state": simulation.save_state()},
        "saved": {"map.npz": (folder / "map.npz").read_bytes()},
        "submission": {"mine.json": (folder / "mine.json").read_bytes()},
        "dataset": {"dataset.json": (folder / "dataset.json").read_bytes()},
        "tum": {"a.tum": (folder / "a.tum").read_bytes()},
    }  # fmt: skip
    shutil.rmtree(folder)
    return found


if __name__ == "__main__":
    main()
