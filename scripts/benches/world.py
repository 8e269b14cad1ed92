# SPDX-License-Identifier: Apache-2.0
"""The rows of ``mobilia bench`` about the world, and what all rows need.

Figures are medians of ``REPEATS`` repeats of processor time.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from functools import partial
from itertools import islice
from typing import Any

import gymnasium
import mujoco
import numpy as np

import sim  # noqa: F401  (registers the environments)
from sim.core.packed import packed
from sim.gym.vector import MobiliaVectorEnv
from sim.sensors.lidar.device import LaserScanner, ScanResult
from sim.sensors.lidar.models.lms221 import Lms221Config
from sim.sensors.lidar.windows import note
from sim.simulation import Simulation, n_frames, tour
from sim.view import gl
from sim.view.camera import Camera
from sim.world.substeps import SUBSTEPS_PER_S, unseen
from sim.world.world import World
from slam._jit import njit

SEED = 100
DYNAMISM = 0.5
REPEATS = 7
N_ENVS = 4
SHORT_S = 2.0  # of an episode
Row = dict[str, Any]


def row(what: str, figure: float, unit: str, target: str, how: str) -> Row:
    """One line of the table."""
    return {"what": what, "figure": float(figure), "unit": unit, "target": target, "how": how}


def timed(work: Callable[[], object]) -> float:
    """s of processor time, all threads."""
    start = time.process_time()
    work()
    return time.process_time() - start


def median(work: Callable[[], object]) -> float:
    """s, of ``REPEATS`` calls of ``work``, after one that does not count."""
    return float(np.median([timed(work) for _ in range(REPEATS + 1)][1:]))


def many(times: int, call: Callable[..., object], *arguments: Any) -> Callable[[], None]:
    """Work: the same call so many times."""

    def work() -> None:
        for _ in range(times):
            call(*arguments)

    return work


def simulation(seconds: float) -> Iterator[Row]:
    """Everything there is, at its defaults."""
    for scene, target in (("office", "≥ 20"), ("arena", "")):
        room = Simulation(scene, seed=SEED, dynamism=DYNAMISM)
        part = n_frames(seconds / REPEATS, room.scan_period_s)
        frames = tour(room, seconds + 10.0)
        spent_s = median(lambda frames=frames, part=part: list(islice(frames, part)))  # type: ignore[misc]
        figure = part * room.scan_period_s / spent_s
        how = f"{scene}: world, actors, scans with every effect, odometry, tour driving"
        yield row(f"simulation, {scene}", figure, "× real time", target, how)


@njit
def note_poses(noted: Any, times: int) -> None:
    """Note all poses, in compiled code as ``sim.world.substeps.advance`` does."""
    for _ in range(times):
        note(noted)


def scanner(seconds: float) -> Iterator[Row]:
    """Scans of a world at rest."""
    world = World("office", seed=SEED, dynamism=DYNAMISM)
    crowded = World("office", seed=SEED, dynamism=DYNAMISM, n_chairs=200)
    cases = (
        ("ideal", Lms221Config.ideal(), world, "≤ 60"),
        ("noise only", Lms221Config.noise_only(), world, ""),
        ("every effect (default)", Lms221Config(), world, "≤ 350"),
        ("ideal, 200 chairs", Lms221Config.ideal(), crowded, "≤ 150"),
    )
    scans = max(20, round(10 * seconds))
    for name, config, room, target in cases:
        how = f"361 beams in {room.scene.name}, world at rest, called as a simulation does"
        yield row(f"scan, {name}", scan_us(room, config, scans), "µs", target, how)
    yield from effects(world, scans)


def effects(world: World, scans: int) -> Iterator[Row]:
    """What each effect of the scanner adds to a scan that has all of them, in turn with it."""
    whole = Lms221Config()
    without = {"noise": replace(whole, noise_std_m=0.0), "rounding": replace(whole, quantise=False)}
    for field in fields(whole.effects):
        if getattr(whole.effects, field.name):
            off = replace(whole.effects, **{field.name: False})
            without[field.name.replace("_", " ")] = replace(whole, effects=off)
    for name, config in without.items():
        pairs = [(scan_us(world, whole, scans), scan_us(world, config, scans)) for _ in range(3)]
        saved = float(np.median([a - b for a, b in pairs]))
        how = "every effect, less the same without this one; they share work"
        yield row(f"scan, effect: {name}", saved, "µs", "", how)


def scan_us(world: World, config: Lms221Config, scans: int) -> float:
    """µs of a scan of a world at rest."""
    laser = LaserScanner(world.model, config, np.random.default_rng(0))
    return median(many(scans, scan, laser, world)) / scans * 1e6


def scan(laser: LaserScanner, world: World) -> ScanResult:
    """One of a world at rest, made as a simulation does."""
    note_poses(laser.begin(world.data), int(laser.window.marks[1:].sum()))
    return laser.finish()


def physics(seconds: float) -> Iterator[Row]:
    """Substeps without a scanner."""
    cases: tuple[tuple[str, dict[str, Any], str], ...] = (
        ("office", {}, ""),
        ("50 chairs, 10 people", {"n_chairs": 50, "n_people": 10}, "≥ 9000"),
    )
    scans = max(40, round(seconds / REPEATS * SUBSTEPS_PER_S / 8))
    for name, options, target in cases:
        world = World("office", seed=SEED, dynamism=DYNAMISM, **options)
        spent_s = median(many(scans, world.advance, 0, 8, packed(unseen(9))))
        how = "office, 1/300 s each, people and doors in, eight in a call"
        yield row(f"physics steps, {name}", 8 * scans / spent_s, "1/s", target, how)


def environments(seconds: float) -> Iterator[Row]:
    """Steps of one scan under a new random command each second, and resets."""
    steps = max(20, round(37.5 * seconds / REPEATS))
    ideal = Lms221Config.ideal()
    for scene, least in (("Arena", 2000), ("Office", 1000)):
        id_ = f"mobilia/{scene}-v2"
        for name, laser in (("ideal scan", ideal), ("every effect", None)):
            env: Any = gymnasium.make(id_, disable_env_checker=True, time_limit_s=1e6, laser=laser)
            vector = gymnasium.make_vec(
                id_, num_envs=N_ENVS, vectorization_mode="vector_entry_point",
                time_limit_s=1e6, laser=laser,
            )  # fmt: skip
            for what, room, n, target in (
                ("single", env.unwrapped, 1, least),
                (f"vector of {N_ENVS}", vector, N_ENVS, 1.5 * least),
            ):
                room.reset(seed=SEED)
                figure = n * steps / stepping(room, steps, n)
                wanted = f"≥ {target:.0f}" if laser is ideal else ""
                how = f"{scene.lower()}, one 0.5° scan a step, one core"
                yield row(f"env steps, {what}, {name}", figure, "1/s", wanted, how)
        if scene == "Office":
            yield ceiling(env.unwrapped.simulation.world)
        resets = [timed(partial(env.reset, seed=k)) for k in range(9)]
        wanted = "≤ 50" if scene == "Office" else ""
        how = f"{scene.lower()}, every effect, another seed each time"
        yield row("env reset", float(np.median(resets)) * 1e3, "ms", wanted, how)
    for n in (2, N_ENVS):
        for workers in (0, 2):
            yield from short_episodes(n, workers, 2 * steps)


def short_episodes(n: int, workers: int, steps: int) -> Iterator[Row]:
    """Rooms whose episodes of 2 s end one after the other: what a reset does to the rest."""
    rooms = MobiliaVectorEnv(n, n_workers=workers, scene="office", time_limit_s=SHORT_S)
    rooms.reset(seed=SEED)
    still, scans = np.zeros((n, 2), np.float32), round(37.5 * SHORT_S)
    for k in range(scans):
        if any(turns := np.arange(n) * scans // n == k):
            rooms.reset(options={"reset_mask": turns})
        rooms.step(still)
    spent = np.zeros(steps)
    for k in range(steps):
        begun = time.perf_counter()
        rooms.step(still)
        spent[k] = time.perf_counter() - begun
    rooms.close()
    what = f"env steps, {n} rooms, 2 s episodes, {workers or 'no'} workers"
    how = "office, every effect; by the wall, so that what else runs counts"
    yield row(f"{what}: mean step", spent.mean() * 1e3, "ms", "", how)
    yield row(f"{what}: worst step", spent.max() * 1e3, "ms", "", how)


def stepping(room: Any, steps: int, n: int) -> float:
    """s for ``steps`` steps of ``n`` environments."""
    rng = np.random.default_rng(SEED)

    def run() -> None:
        for k in range(steps):
            if k % 37 == 0:
                action = rng.uniform(-1.0, 1.0, (n, 2)).astype(np.float32)
            room.step(action if n > 1 else action[0])

    return median(run)


def ceiling(world: World) -> Row:
    """What no environment can beat: the eight ``mj_step`` of a scan and nothing else."""
    spent_s = median(many(800, mujoco.mj_step, world.model, world.data))
    how = "office: MuJoCo's own 8 steps a scan, no actors, no scan"
    return row("ceiling of env steps by physics", 100 / spent_s, "1/s", "", how)


def pictures(seconds: float) -> Iterator[Row]:
    """The 3D picture of a film."""
    if gl.find().backend is None:
        return
    room = Simulation("office", seed=SEED, dynamism=DYNAMISM)
    for shadows, target in ((True, "≤ 110"), (False, "")):
        with Camera(room.world.model, 1280, 720, shadows=shadows) as camera:
            spent_s = median(partial(camera.render, room.world.data))
        what = "picture 1280 × 720, office, " + ("with shadows" if shadows else "no shadows")
        yield row(what, spent_s * 1e3, "ms", target, "all threads; software GL")
