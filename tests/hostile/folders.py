# SPDX-License-Identifier: Apache-2.0
"""Folders of somebody who wants our machine to run his code: it would touch a file in ``ran``."""

import json
import pathlib
import shutil
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from scripts.benchmark import runs_file, submission
from scripts.closed_loop.plan import DrivePlan
from scripts.comparison.plan import ENTRIES, RECORDINGS, Plan
from scripts.output import write_recipe
from sim.recording import recipe as recipes
from sim.recording.dataset import Plan as DatasetPlan
from sim.recording.recipe import RECIPE, Recipe, read_recipe
from sim.recording.sums import write_sums
from slam.maps import write_map
from slam.system import Raster
from tests.scripts.benchmark.test_submission import made as submitted
from tests.scripts.report import made

SCENE, SLAM = "evilmod:boom", "evilmod:Slam"
SHADOWED = (
    "numpy", "typer", "mujoco", "joblib", "matplotlib", "rich", "scripts", "sim", "slam", "scenes",
    "sitecustomize", "usercustomize", "conftest", "yaml", "cv2", "imageio", "gymnasium", "json",
)  # fmt: skip
MODULE = """
from pathlib import Path
Path({ran!r}, "evilmod").touch()
from scenes.random_rooms import random_rooms as boom
from slam.odometry import OdometrySlam
class Slam(OdometrySlam):
    pass
"""


class Bomb:
    """Unpickled, it touches a file."""

    def __init__(self, ran: Path) -> None:
        self.file = ran / "pickle"

    def __reduce__(self) -> tuple[Callable[..., None], tuple[Path]]:
        return pathlib.Path.touch, (self.file,)


class Hostile:
    """``path`` holds bait for one verb; the working folder of who opens it."""

    def __init__(self, path: Path, ran: Path, episode: Path) -> None:
        self.path, self.ran, self.whole = path, ran, episode
        path.mkdir()
        (path / "evilmod.py").write_text(MODULE.format(ran=str(ran)))
        for name in SHADOWED:
            touch = f"import pathlib; pathlib.Path({str(ran)!r}, {name!r}).touch()\n"
            (path / f"{name}.py").write_text(touch)
        (path / "evil.pth").write_text(f"import pathlib; pathlib.Path({str(ran)!r}, 'pth').touch()")
        (path / "matplotlibrc").write_text("backend: module://evilmod\nfont.size: 99\n")
        (path / ".numba_config.yaml").write_text(f"cache_dir: {ran / 'numba'}\n")

    @property
    def pipe(self) -> str:
        return f"pipe:touch {self.ran / 'pipe'}"

    def pickled(self, path: Path, *names: str) -> Path:
        """An archive whose arrays are objects."""
        path.parent.mkdir(parents=True, exist_ok=True)
        bomb = np.array([Bomb(self.ran)], dtype=object)
        np.savez(path, allow_pickle=True, **dict.fromkeys(names, bomb))
        return path

    def submission(self) -> Path:
        """A result file of ``mobilia benchmark``."""
        path = self.path / submission.file_of("mine")
        runs_file.write(path, replace(submitted(), slam=self.pipe))
        return path

    def run(self, *, scene: str = SCENE, slam: str = SLAM, **more: Any) -> Path:
        """What ``mobilia run`` leaves, as far as it is opened."""
        folder = self.path / "run"
        folder.mkdir()
        settings = {"slams": [slam, "odometry"], "scene": scene, "seconds": 0.3, "seed": 1, **more}
        write_recipe(folder, "run", settings)
        return folder

    def episode(self, scene: str = SCENE, session: int | None = None) -> Path:
        """A whole one, whose sums are right, but for the scene and the session."""
        folder = self.path / "episode"
        shutil.copytree(self.whole, folder)
        real = read_recipe(folder / RECIPE)
        other = replace(real.recipe, scene=scene, session=session)
        recipes.write_recipe(folder / RECIPE, other, real.result)
        write_sums(folder)
        return folder

    def dataset(self) -> tuple[Path, list[str]]:
        """Of an honest scene; the words that go on with it. An episode names another scene."""
        out = self.path / "data"
        recipe = Recipe(scene="arena", seed=1, dynamism=0.5, seconds=0.1)
        plan = DatasetPlan(recipe=recipe, dynamisms=(0.5,), episodes=2)
        episode = self.episode()
        out.mkdir()
        episode.rename(out / plan.recipe.name)
        (out / "dataset.json").write_text(plan.text())
        words = ["arena", "--seed", "1", "--seconds", "0.1", "--episodes", "2", "--out", "data"]
        return out, words

    def comparison(self, *, slam: str = SLAM, scene: str = SCENE) -> Path:
        """One run of it, of which the file is objects."""
        plan = Plan(slams=(slam,), scenes=(scene,), levels=(0.5,), seeds=(100,), seconds=0.5)
        out = self.path / "compared"
        out.mkdir()
        write_recipe(out, "compare", {"compare_schema": 1, **asdict(plan)})
        return self.pickled(out / "runs" / f"{plan.runs()[0].name}.npz", "slams", "schema")

    def begun_comparison(self) -> list[str]:
        """Recordings and entries where an honest comparison looks for them, all objects."""
        self.comparison()
        out = self.path / "compared"
        plan = Plan(slams=("odometry",), scenes=("arena",), levels=(0.5,), seeds=(1,), seconds=0.5)
        for job in plan.recordings().values():
            self.pickled(out / RECORDINGS / job.file_name(), "laser_n_beams", "stamps_ns", "truth")
        for _, _, job in plan.entries():
            self.pickled(out / ENTRIES / job.file_name(), "row")
        words = ["--slam", "odometry", "--scene", "arena", "--dynamism", "0.5", "--seeds", "1"]
        return [*words, "--first-seed", "1", "--seconds", "0.5", "--out", "compared"]

    def begun_drive(self) -> list[str]:
        """The same of ``mobilia drive``."""
        out = self.path / "driven"
        plan = DrivePlan(scene="arena", slams=("odometry",), levels=(0.5,), seeds=(1,), goals=1)
        for _, job in plan.jobs():
            self.pickled(out / "runs" / job.file_name(), "rest", "stamps_ns")
        write_recipe(out, "drive", {"drive_schema": 1, "scene": SCENE, "slams": [SLAM]})
        words = ["arena", "--slam", "odometry", "--dynamism", "0.5", "--seeds", "1", "--goals", "1"]
        return [*words, "--out", "driven"]

    def report(self) -> Path:
        """A comparison with tables, naming code."""
        folder = made.make(self.path / "compared", seeds=(100,))
        settings = json.loads((folder / "recipe.json").read_text())["settings"]
        settings |= {"slams": [self.pipe, SLAM], "scenes": [SCENE]}
        write_recipe(folder, "compare", settings)
        for run in (folder / "runs").iterdir():
            self.pickled(run, "slams", "schema", "stamps_ns", "truth")
        return folder

    def bag(self) -> Path:
        """An honest bag whose metadata asks for Python objects."""
        folder = self.episode("arena")
        text = (folder / "metadata.yaml").read_text()
        tag = f"!!python/object/apply:os.system ['touch {self.ran / 'yaml'}']"
        (folder / "metadata.yaml").write_text(text + f"evil: {tag}\n")
        return folder

    def map_yaml(self) -> Path:
        """A map_server file that asks for Python objects."""
        raster = Raster(
            values=np.zeros((2, 2), np.float32), resolution_m=0.1, T_map_origin=np.zeros(3)
        )
        _, yaml = write_map(self.path / "map", raster)
        tag = f"!!python/object/apply:os.system ['touch {self.ran / 'yaml'}']"
        yaml.write_text(yaml.read_text() + f"negate: {tag}\n")
        return yaml
