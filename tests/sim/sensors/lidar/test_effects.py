# SPDX-License-Identifier: Apache-2.0
"""Each effect of the range model by itself, against what the manufacturer says of it."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sim.sensors.lidar.device import LaserScanner, ScanResult
from sim.sensors.lidar.models.lms221 import Lms221Config, RangeEffects
from sim.sensors.lidar.receiver import error_function
from sim.sensors.lidar.scanner import Band
from sim.sensors.lidar.surfaces import reflectivity_of

NONE = RangeEffects.none()
MATERIALS = "".join(
    f'<asset><material name="{name}" rgba="1 1 1 {alpha}"/></asset>'
    for name, alpha in (("glass", 0.3), ("rubber", 1), ("paper", 1), ("wall", 1), ("mirror", 1))
)


def look(
    room: SimpleNamespace, world: str, *, seed: int = 0, noise: float = 0.0, **effects: bool
) -> tuple[ScanResult, LaserScanner]:
    """One scan of ``world`` with only the named effects on."""
    config = Lms221Config(noise_std_m=noise, quantise=False, effects=replace(NONE, **effects))
    text = world + "</worldbody>" + MATERIALS + "<worldbody>"
    model, data = room.build(text)
    lidar = LaserScanner(model, config, np.random.default_rng(seed))
    return lidar.observe(room.stepper(model, data), data), lidar


def test_black_rubber_vanishes_close_by_and_far_away(room: SimpleNamespace) -> None:
    """2 % is less than what is needed below 2 m and above 10 m (TD fig. 4-2)."""
    for distance, seen in ((1.0, False), (5.0, True), (12.0, False)):
        for material, expected in (("rubber", seen), ("paper", True)):
            world = room.wall(distance + 0.12, 0, 0.1, 3, f'material="{material}"')
            result, _ = look(room, world, reflectivity=True)
            assert np.isfinite(result.ranges[180]) == expected
            assert (result.geoms[180] >= 0) == expected


def test_an_oblique_dark_wall_returns_less(room: SimpleNamespace) -> None:
    world = room.wall(0.0, 5.1, 30.0, 0.1, 'material="rubber"')
    for incidence in (False, True):
        result, lidar = look(room, world, reflectivity=True, incidence=incidence)
        square = np.abs(lidar.spec.angles - math.pi / 2) < math.radians(10.0)
        oblique = np.abs(lidar.spec.angles - math.radians(40.0)) < math.radians(5.0)
        assert np.isfinite(result.ranges[square]).all()
        assert np.isfinite(result.ranges[oblique]).any() != incidence


def test_the_first_pulse_wins_and_edges_mix(room: SimpleNamespace) -> None:
    """A post narrower than the spot, 0.6 m before a wall: with mixing, values in between."""
    post = '<geom type="cylinder" size=".012 1" pos="4.02 0 .5" material="paper"/>'
    world = post + room.wall(4.72, 0, 0.1, 3, 'material="paper"')
    plain, _ = look(room, world, spot=True, reflectivity=True)
    near = np.abs(plain.ranges[175:186] - 3.99) < 0.03
    assert near.any()
    assert not near.all()
    between = 0
    for seed in range(20):
        mixed, _ = look(room, world, seed=seed, spot=True, reflectivity=True, mixed_pixels=True)
        values = mixed.ranges[mixed.mixed]
        between += values.size
        assert ((values > 3.97) & (values < 4.65)).all()
    assert between > 20


def test_a_thin_post_is_lost_between_ideal_rays_but_not_under_the_spot(room: SimpleNamespace):
    post = '<geom type="cylinder" size=".004 1" pos="6.02 .026 .5" material="paper"/>'
    ideal, _ = look(room, post)
    spot, _ = look(room, post, spot=True)
    assert not np.isfinite(ideal.ranges).any()
    assert 1 <= int(np.isfinite(spot.ranges).sum()) <= 4


def test_a_pane_is_seen_only_near_its_normal(room: SimpleNamespace) -> None:
    world = room.wall(2.03, 0, 0.01, 3, 'material="glass"') + room.wall(5.12, 0, 0.1, 6)
    opaque, _ = look(room, world)
    clear, lidar = look(room, world, glass=True)
    ahead = np.abs(lidar.spec.angles) < math.radians(45.0)
    normal = np.abs(lidar.spec.angles) < math.radians(4.9)
    np.testing.assert_allclose(opaque.ranges[normal], clear.ranges[normal])
    through = ahead & (np.abs(lidar.spec.angles) > math.radians(5.1))
    np.testing.assert_allclose(
        clear.ranges[through], 5.0 / np.cos(lidar.spec.angles[through]), rtol=1e-6
    )
    assert (opaque.ranges[through] < 2.9).all()


def slanted(material: str, at: float = 3.0) -> str:
    """A wall at 45 degrees across the way ahead, 6 m wide."""
    return (
        f'<geom type="box" size=".01 3 1" pos="{at} 0 1" euler="0 0 {math.pi / 4}" '
        f'material="{material}"/>'
    )


def test_a_mirror_shows_what_lies_round_the_corner(room: SimpleNamespace) -> None:
    """A beam ahead turns by 90 degrees at a mirror at 45 degrees: 3 m there, 2 m on."""
    world = slanted("mirror") + room.wall(3, 2.1, 2, 0.1, 'material="paper"')
    world += room.wall(3, -2.1, 2, 0.1, 'material="paper"')
    surface, _ = look(room, world)
    switched, lidar = look(room, world, spot=True, reflectivity=True, bounce=True)
    assert surface.ranges[180] == pytest.approx(3.0 - 0.02 - 0.01 * math.sqrt(2.0), abs=1e-3)
    straight = lidar.spec.angles[180]
    assert straight == pytest.approx(0.0, abs=1e-12)
    assert switched.ghost[180]
    assert switched.ranges[180] == pytest.approx(surface.ranges[180] + 2.0, abs=0.02)
    assert not look(room, world, spot=True, reflectivity=True)[0].ghost.any()


def test_a_pane_at_a_grazing_angle_shows_a_ghost_and_square_on_none(room: SimpleNamespace) -> None:
    """Schlick: 8 % each way square on, not enough to be seen; more than 40 % below 10 degrees."""
    pane = room.wall(4.0, -0.3, 3.5, 0.01, 'material="glass"')
    on = {"spot": True, "reflectivity": True, "incidence": True, "glass": True, "bounce": True}
    result, lidar = look(room, pane + room.wall(8.1, 2, 0.1, 2.1, 'material="paper"'), **on)
    seen = np.flatnonzero(result.ghost)
    angles = lidar.spec.angles[seen]
    assert seen.size > 5
    assert (np.abs(angles) < math.radians(30.0)).all()
    np.testing.assert_allclose(result.ranges[seen], 7.98 / np.cos(angles), rtol=1e-3)
    square = room.wall(3.0, 0, 0.01, 2, 'material="glass"') + room.wall(-2, 0, 0.1, 4)
    assert not look(room, square, **on)[0].ghost.any()


def test_the_counter_counts_in_centimetres_also_in_millimetre_mode(room: SimpleNamespace) -> None:
    for systematic in (False, True):
        config = Lms221Config(
            range_mode="32m", effects=replace(NONE, timer=True, systematic=systematic)
        )
        model, data = room.build()
        lidar = LaserScanner(model, config, np.random.default_rng(4))
        advance = room.stepper(model, data)
        scans = [lidar.observe(advance, data) for _ in range(60)]
        errors = np.array([s.ranges - s.true_ranges for s in scans])
        assert errors.std(axis=0).mean() == pytest.approx(0.010, rel=0.03)
        values = np.unique(np.rint(np.array([s.ranges[100] for s in scans]) * 1e3).astype(int))
        assert (np.diff(values) >= 9).all()
        assert (values % 10 == 0).all() != systematic


def test_no_return_is_an_error_code_as_the_driver_has_it(room: SimpleNamespace) -> None:
    """STW: no stop signal becomes NaN; a value beyond the largest code +inf (REP 117)."""
    far = room.wall(12.1, 0.0, 0.1, 1.0)
    text = far + "</worldbody>" + MATERIALS + "<worldbody>"
    for error_codes in (False, True):
        config = Lms221Config(range_mode="8m", effects=replace(NONE, error_codes=error_codes))
        model, data = room.build(text)
        result = LaserScanner(model, config).observe(room.stepper(model, data), data)
        assert result.ranges[180] == np.inf
        assert np.isnan(result.ranges[0]) == error_codes


def test_the_systematic_error_is_smooth_bounded_and_of_the_unit(room: SimpleNamespace) -> None:
    """TD p34, over 20 units, black to white."""
    curves = []
    for seed in range(20):
        by_range, by_reflectivity = error_function(
            (Band(up_to_m=80.0, error_m=0.035),), np.random.default_rng(seed)
        )
        curves.append(by_range[10:201])
        assert np.abs(by_range[10:201]).max() + abs(by_reflectivity) <= 0.035
    errors = np.array(curves)
    assert np.abs(errors).max() > 0.015
    assert np.abs(np.diff(errors, axis=1)).max() < 0.02
    assert errors.std(axis=0).min() > 0.003
    first, second = (look(room, room.SQUARE, seed=seed, systematic=True)[0] for seed in (1, 2))
    for result in (first, second):
        error = result.ranges - result.true_ranges
        assert 0.0 < np.abs(error).max() <= 0.05
    assert not np.array_equal(first.ranges, second.ranges)


def test_a_switch_does_not_change_what_other_effects_draw(room: SimpleNamespace) -> None:
    noise = []
    for effects in (NONE, replace(NONE, mixed_pixels=True, dropout_rate=0.1)):
        model, data = room.build()
        config = Lms221Config(quantise=False, effects=effects)
        result = LaserScanner(model, config, np.random.default_rng(3)).observe(
            room.stepper(model, data), data
        )
        noise.append(result.ranges)
    kept = np.isfinite(noise[1])
    assert 0.8 < kept.mean() < 0.97
    np.testing.assert_array_equal(noise[0][kept], noise[1][kept])


@pytest.mark.parametrize(
    ("material", "value"),
    [("wall", 0.8), ("wall_cap", 0.8), ("trousers_black", 0.08), ("trousers_khaki", 0.2)],
)
def test_reflectivity_goes_by_the_longest_known_beginning(material: str, value: float) -> None:
    assert reflectivity_of(material) == value
    assert reflectivity_of("chair3/" + material) == value
    assert reflectivity_of("unobtainium") == 0.5
