# SPDX-License-Identifier: Apache-2.0
"""``mobilia bench``: speed figures of this machine, as a table and as JSON."""

from __future__ import annotations

import dataclasses
import json
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from scripts.console import console
from scripts.output import machine, versions
from slam.errors import InvalidValueError
from slam.files import write_text

SEED = 100
DYNAMISM = 0.5
Row = dict[str, Any]


def bench(
    seconds: Annotated[float, typer.Option(help="Simulated seconds for each measurement, s.")] = 20,
    out: Annotated[
        Path | None, typer.Option("--json", help="Also write the figures to this JSON file.")
    ] = None,
) -> None:
    """Measure the speed of simulation, scanner, environment and SLAM on this machine.

    Everything is processor time of one thread after a warm-up, at dynamism 0.5, seed 100, scanner
    and odometry at their defaults (LMS-221, 0.5 degrees, 361 beams; pioneer3dx) unless a row says
    otherwise. Targets are those of the design, for one core of a 2020s server.
    """
    if not 1.0 <= seconds <= 3600.0:
        raise InvalidValueError(f"--seconds must lie in [1, 3600] s, got {seconds}")
    rows: list[Row] = []
    table = Table(title="Speed", title_justify="left", caption=str(machine()["processor"]))
    for heading in ("what", "figure", "unit", "target", "how"):
        table.add_column(heading, justify="right" if heading == "figure" else "left")
    for measure in (_simulation, _scanner, _physics, _environment, _pictures, _slam, _datasets):
        with console.status(f"measuring: {measure.__name__.strip('_')}"):
            found = list(measure(seconds))
        for row in found:
            rows.append(row)
            table.add_row(
                row["what"], f"{row['figure']:.3g}", row["unit"], row["target"], row["how"]
            )
    console.print(table)
    if out is not None:
        report = {"schema": 1, "machine": machine(), "versions": versions(), "rows": rows}
        write_text(out, json.dumps(report, indent=2) + "\n")


def _row(what: str, figure: float, unit: str, target: str, how: str) -> Row:
    return {"what": what, "figure": float(figure), "unit": unit, "target": target, "how": how}


def _timed(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _simulation(seconds: float) -> Iterator[Row]:
    from sim.simulation import Simulation, n_frames, tour

    for scene, target in (("office", "≥ 20"), ("arena", "")):
        simulation = Simulation(scene, seed=SEED, dynamism=DYNAMISM)
        frames = tour(simulation, seconds + 2.0)
        for _ in range(n_frames(2.0, simulation.scan_period_s)):
            next(frames)
        spent = _timed(lambda frames=frames: [None for _ in frames])  # type: ignore[misc]
        how = f"{scene}: world, actors, scans, odometry, tour driving"
        yield _row(f"simulation, {scene}", seconds / spent, "× real time", target, how)


def _scanner(seconds: float) -> Iterator[Row]:
    from sim.lidar import Lms221, Lms221Config
    from sim.world import World

    world = World("office", seed=SEED, dynamism=DYNAMISM)
    crowded = World("arena", seed=SEED, dynamism=DYNAMISM, n_chairs=50)
    cases = (
        ("ideal", Lms221Config.ideal(), world, "≤ 60"),
        ("noise only", Lms221Config.noise_only(), world, ""),
        ("every effect (default)", Lms221Config(), world, "≤ 350"),
        ("ideal, arena with 50 chairs", Lms221Config.ideal(), crowded, ""),
    )
    for name, config, world, target in cases:
        laser = Lms221(world.model, config, np.random.default_rng(0))
        laser.observe(lambda: None, world.data)
        scans = max(20, round(20 * seconds))

        def many(laser: Lms221 = laser, world: World = world, scans: int = scans) -> None:
            for _ in range(scans):
                laser.observe(lambda: None, world.data)

        figure = _timed(many) / scans * 1e6
        how = f"361 beams in {world.scene.name}, world at rest"
        yield _row(f"scan, {name}", figure, "µs", target, how)


def _physics(seconds: float) -> Iterator[Row]:
    from sim.world import SUBSTEPS_PER_S, World

    world = World("office", seed=SEED, dynamism=DYNAMISM)

    def run(duration_s: float) -> None:
        for _ in range(round(duration_s * SUBSTEPS_PER_S)):
            world.substep()

    run(2.0)
    figure = seconds * SUBSTEPS_PER_S / _timed(lambda: run(seconds))
    yield _row("physics steps, office", figure, "1/s", "", "1/300 s each, people and doors in")


def _environment(seconds: float) -> Iterator[Row]:
    import gymnasium

    import sim  # noqa: F401  (registers the environments)

    for id_, target in (("mobilia/Arena-v0", ""), ("mobilia/Office-v0", "")):
        env = gymnasium.make(id_, disable_env_checker=True, time_limit_s=1e6).unwrapped
        env.reset(seed=SEED)
        resets = [_timed(lambda env=env, k=k: env.reset(seed=k)) for k in range(5)]  # type: ignore[misc]
        action = np.array([0.5, 0.2], np.float32)
        steps = round(37.5 * seconds)

        def run(env: Any = env, steps: int = steps, action: Any = action) -> None:
            for _ in range(steps):
                env.step(action)

        yield _row(f"env steps, {id_}", steps / _timed(run), "1/s", target, "one scan a step")
        yield _row(f"env reset, {id_}", float(np.median(resets)) * 1e3, "ms", "", "median of 5")


def _pictures(seconds: float) -> Iterator[Row]:
    from sim import gl
    from sim.pictures import CameraPicture
    from sim.simulation import Simulation

    if gl.find().backend is None:
        return
    simulation = Simulation("office", seed=SEED, dynamism=DYNAMISM)
    for shadows, target in ((True, "≤ 110"), (False, "")):
        with CameraPicture(simulation, (1280, 720), "persp", shadows=shadows) as picture:
            picture(simulation)
            spent = [_timed(lambda picture=picture: picture(simulation)) for _ in range(10)]  # type: ignore[misc]
        what = "picture 1280 × 720, office, " + ("with shadows" if shadows else "no shadows")
        yield _row(what, float(np.median(spent)) * 1e3, "ms", target, "all threads; software GL")


def _datasets(seconds: float) -> Iterator[Row]:
    from scripts.bench_dataset import rows

    yield from rows(seconds, seed=SEED, dynamism=DYNAMISM)


def _slam(seconds: float) -> Iterator[Row]:
    from sim.simulation import stream
    from slam.shunting import ShuntingConfig, ShuntingSlam

    frames = list(stream("office", seed=SEED, dynamism=DYNAMISM, seconds=seconds + 2.0))
    blind = [frame.without_truth() for frame in frames]
    coarse = ShuntingConfig(cell_m=0.05)
    for what, stride, config, stream_, targets in (
        ("shunting, 37.5 Hz", 1, ShuntingConfig(), blind, ("≤ 3, aim 1", "")),
        ("shunting, 4.7 Hz", 8, ShuntingConfig(), blind, ("≤ 3, aim 1", "≥ 100")),
        ("shunting, 5 cm cells, 181 beams", 1, coarse, _halved(blind), ("aim 0.5", "")),
    ):
        slam = ShuntingSlam(config)
        spent = [_timed(lambda f=f, s=slam: s.update(f)) for f in stream_[::stride]]  # type: ignore[misc]
        steady = np.array(spent[5:]) * 1e3
        how = "office, every effect; 361 beams and 3 cm cells unless said otherwise"
        yield _row(f"{what}, p50", float(np.percentile(steady, 50)), "ms", targets[0], how)
        yield _row(f"{what}, p99", float(np.percentile(steady, 99)), "ms", "", how)
        period_ms = 1e3 * stride / 37.5
        yield _row(what, period_ms / float(steady.mean()), "× real time", targets[1], how)
        if stride == 1 and config != coarse:
            memory = slam.network.bytes_per_neuron()
            yield _row(
                "network", memory, "B a live neuron", "≤ 40", "office, every array, at the end"
            )


def _halved(frames: list[Any]) -> list[Any]:
    """Every second beam of each scan."""
    spec = frames[0].scan.spec
    half = dataclasses.replace(
        spec,
        n_beams=(spec.n_beams + 1) // 2,
        angle_increment=2.0 * spec.angle_increment,
        beam_time_offsets=spec.beam_time_offsets[::2],
    )
    scans = [dataclasses.replace(f.scan, ranges=f.scan.ranges[::2], spec=half) for f in frames]
    return [dataclasses.replace(f, scan=s) for f, s in zip(frames, scans, strict=True)]


def _area(seconds: float) -> Iterator[Row]:
    """One scan in a map of ever more rooms like the one the robot is in."""
    from sim.simulation import stream
    from slam.shunting import ShuntingConfig, ShuntingSlam

    slam = ShuntingSlam(ShuntingConfig(cell_m=0.05))
    frames = list(stream("arena", seed=SEED, dynamism=DYNAMISM, seconds=seconds / 2.0 + 8.0))
    for frame in frames[:-150]:
        slam.update(frame.without_truth())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arena.npz"
        slam.save(path)
        for times in (1, 10, 100, 1000):
            slam = ShuntingSlam.load(path)
            enlarge(slam.network, times)
            yield _in_area(slam, frames[-150:], times)


def _in_area(slam: Any, frames: list[Any], times: int) -> Row:
    spent = [_timed(lambda f=f: slam.update(f.without_truth())) for f in frames]  # type: ignore[misc]
    extent = slam.network.extent()
    square_m = (extent[2] - extent[0]) * (extent[3] - extent[1]) * 0.05**2
    how = f"median of 150 scans, arena, 5 cm cells, {times} × the rooms"
    what = f"shunting in a map of {square_m:.3g} m²"
    return _row(what, float(np.median(spent)) * 1e3, "ms", "flat within 20 %", how)


def enlarge(network: Any, times: int) -> None:
    """Let copies of all that lives be there ``times`` times, in a square beside itself."""
    from slam.shunting.cells import living
    from slam.shunting.memory import fill

    slots, places = living(network.cells)
    side = places.max(axis=0) - places.min(axis=0) + 9
    across = math.ceil(math.sqrt(times))
    for k in range(1, times):
        arrays = {n: getattr(network.cells, n)[slots] for n in ("x", "y", "age", "facing")}
        fill(network, arrays | {"places": places + side * (k % across, k // across)})
