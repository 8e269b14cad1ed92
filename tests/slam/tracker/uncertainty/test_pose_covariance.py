# SPDX-License-Identifier: Apache-2.0
"""Honest covariances: against sampling, with known errors, and where walls say nothing."""

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from slam import se2
from slam.frames import Float, Frame, Odometry, Scan
from slam.frontend.observations import from_scan
from slam.frontend.odometry_prior import Prediction
from slam.shunting import ShuntingConfig, ShuntingSlam
from slam.system import Estimate
from slam.tracker.matching.matcher import Match, Matcher
from slam.tracker.network import Network
from slam.tracker.rasterise import rasterise
from slam.tracker.standing.agreement import Agreement
from slam.tracker.uncertainty.covariances import observable
from slam.tracker.uncertainty.odometry_noise import OdometryNoise, innovation
from slam.tracker.uncertainty.pose_covariance import PoseCovariance
from slam.tracker.uncertainty.residuals import Residuals, residuals_of
from tests.world2d import Drive, World2D, arena, frames, laser, rectangle, wander

CONFIG = ShuntingConfig.robust(cell_m=0.05)
SIGMA_M = CONFIG.frontend.sensor_sigma_m
LONG = World2D(rectangle(-60.0, -1.0, 60.0, 1.01))
ZERO, ZERO33 = np.zeros(3), np.zeros((3, 3))


def moved(*sigmas: float, elapsed: float = 0.2) -> Prediction:
    """Odometry that stands at the origin, with those standard deviations."""
    covariance = np.diag(np.square(sigmas))
    return Prediction(
        T_map_robot=ZERO, increment=ZERO, covariance=covariance, twist=ZERO, elapsed=elapsed
    )


def matched(information: Float, T: Float = ZERO) -> Match:
    """A match of all beams; of none where it says nothing."""
    share = float(information.any())
    return Match(T_map_robot=T, information=information, matched=share, score=0.0, tau=share)


def seen(geometry: Float, weighed: float = 20.0, **more: Any) -> Residuals:
    """Surfaces of that geometry a beam, seen long and with errors of their own."""
    rest: dict[str, Any] = {"in_view": 75.0, "shared": 0.0, "feigned": 0.0, "new": 0.0} | more
    rest = {"paired": weighed, "new_geometry": ZERO, "old": np.zeros(6), "old_off_m2": 0.0} | rest
    return Residuals(geometry=weighed * geometry, weighed=weighed, **rest)


def driven(stream: list[Frame]) -> list[Estimate]:
    system = ShuntingSlam(CONFIG)
    return [system.update(frame.without_truth()) for frame in stream]


@pytest.mark.parametrize("beams", [181, 361])
def test_a_corridor_is_not_observable_along_and_the_covariance_grows_there(beams: int) -> None:
    turned = 0.4  # so that the axis is none of the map's
    drive = Drive((0.0, 0.0, turned), ((0.0, -0.4, 1.0), (0.6, 0.0, 12.0)))
    stream = frames(LONG, drive, rate_hz=5.0, spec=laser(beams), seed=1)
    found = driven(stream)[10:]
    flagged = [e.diagnostics["unobservable"] == 1 for e in found]
    assert np.mean(flagged) > 0.95
    along = np.array([math.cos(-turned), math.sin(-turned)])
    across = np.array([-along[1], along[0]])
    for estimate in found:
        if estimate.diagnostics["unobservable"] == 1:
            angle = estimate.diagnostics["unobservable_rad"]
            assert abs(math.sin(angle + turned)) < 0.05
    variances = np.array([e.covariance[:2, :2] for e in found])
    grown, bounded = variances @ along @ along, variances @ across @ across
    assert (np.diff(grown) > 0.0).mean() > 0.95
    assert grown[-1] > 3.0 * grown[0]
    assert bounded.max() < 0.02**2
    assert all(e.converged for e in found)
    error = found[-1].T_map_robot - se2.between(stream[0].truth, stream[-1].truth)
    assert abs(error[:2] @ along) < 3.0 * math.sqrt(grown[-1])
    assert abs(error[:2] @ across) < 3.0 * math.sqrt(bounded[-1])


@pytest.mark.parametrize("beams", [91, 361])
def test_a_room_is_observable(beams: int) -> None:
    stream = frames(World2D(arena()), wander(6.0), rate_hz=5.0, spec=laser(beams), seed=2)
    found = driven(stream)[1:]
    assert [e.diagnostics["unobservable"] for e in found] == [0] * len(found)
    assert max(float(e.covariance[k, k]) for e in found for k in (0, 1)) < 0.03**2


def test_nothing_in_view_leaves_odometry_alone() -> None:
    stream = frames(World2D(arena()), wander(3.0), rate_hz=5.0, spec=laser(91))[:12]
    system = ShuntingSlam(CONFIG)
    for frame in stream[:6]:
        before = system.update(frame)
    variances = [float(before.covariance[0, 0] + before.covariance[1, 1])]
    for frame in stream[6:]:
        assert frame.scan is not None
        nothing = Scan(
            stamp_ns=frame.stamp_ns, ranges=np.full(91, np.inf, np.float32), spec=frame.scan.spec
        )
        estimate = system.update(dataclasses.replace(frame, scan=nothing, truth=None))
        assert estimate.diagnostics["unobservable"] == 2
        variances.append(float(estimate.covariance[0, 0] + estimate.covariance[1, 1]))
    assert (np.diff(variances) > 0.0).all()


def mapped(world: World2D) -> tuple[Network, list[Scan]]:
    """A network that has seen the world from the origin for long, and fresh scans from there."""
    drive = Drive((0.0, 0.0, 0.0), ((0.0, 0.0, 40.0),))
    scans = [f.scan for f in frames(world, drive, rate_hz=5.0, spec=laser(181), seed=3)]
    network = Network(CONFIG)
    for scan in scans[:80]:
        assert scan is not None
        view = from_scan(scan, np.zeros(3), CONFIG)
        rasterise(network, view, np.zeros(3))
        network.integrate(view.view, view.T_robot_laser, 0.2, write=True)
    return network, [scan for scan in scans[80:] if scan is not None]


def test_matches_scatter_as_their_information_says() -> None:
    """One place, many draws of the beams' noise, a fixed map: sample covariance against claimed."""
    network, scans = mapped(World2D(arena()))
    matcher, flat = Matcher(CONFIG), np.diag([1.0, 1.0, 1.0])
    poses, claimed = [], []
    share = (
        CONFIG.frontend.sensor_sigma_m / (CONFIG.frontend.sigma_cells * CONFIG.cell_m)
    ) ** 2 / 2.0
    for scan in scans:
        view = from_scan(scan, np.zeros(3), CONFIG)
        match = matcher.climb(network, view, np.zeros(3), np.zeros(3), flat)
        poses.append(match.T_map_robot)
        claimed.append(share * np.linalg.inv(match.information))
    sampled, expected = np.cov(np.array(poses).T), np.mean(claimed, axis=0)
    ratios = np.linalg.eigvals(np.linalg.solve(expected, sampled)).real
    assert ratios.min() > 0.2
    assert ratios.max() < 3.0


def test_surface_is_old_by_how_long_it_was_looked_at() -> None:
    """a^2 / (a^2 + (8 s)^2) of the geometry: next to nothing after 1 s, half after 8, all in the
    end; and where the robot sees what the map does not have, nothing."""
    drive = Drive((0.0, 0.0, 0.0), ((0.0, 0.0, 70.0),))
    world, network, shares = World2D(arena()), Network(CONFIG), []
    stream = frames(world, drive, rate_hz=5.0, spec=laser(181), seed=3)
    for k, frame in enumerate(stream):
        assert frame.scan is not None
        view = from_scan(frame.scan, np.zeros(3), CONFIG)
        if k in (5, 40, 320):
            residuals = residuals_of(network, 0.3, view, np.zeros(3), (0.2, 0.0), 0)
            whole = residuals.geometry * (residuals.in_view / residuals.weighed)
            shares.append(residuals.old[[0, 3, 5]] / np.diag(whole))
        rasterise(network, view, np.zeros(3))
        network.integrate(view.view, view.T_robot_laser, 0.2, write=True)
    new, half, old = (float(np.mean(share)) for share in shares)
    assert new < 0.03
    assert 0.3 < half < 0.55
    assert old > 0.8
    elsewhere = residuals_of(network, 0.3, view, np.array([0.8, 0.5, 0.4]), (0.2, 0.0), 0)
    assert elsewhere.old[0] < 0.2 * residuals.old[0]


def test_residuals_of_noise_are_not_shared_and_a_moved_wall_is() -> None:
    network, scans = mapped(World2D(arena()))
    totals = {}
    for name, longer in (("noise", 0.0), ("moved", 0.02)):
        shared = paired = 0.0
        for turn, scan in enumerate(scans):
            ranges = scan.ranges + np.float32(longer)
            longer_scan = Scan(stamp_ns=scan.stamp_ns, ranges=ranges, spec=scan.spec)
            view = from_scan(longer_scan, np.zeros(3), CONFIG)
            residuals = residuals_of(network, 0.3, view, np.zeros(3), (0.2, 0.0), turn)
            shared, paired = shared + residuals.shared, paired + residuals.paired
        totals[name] = shared / paired
    assert abs(totals["noise"]) < 0.003**2
    assert 0.008**2 < totals["moved"] < 0.021**2  # the part of 2 cm along the walls' normals


def test_what_noise_feigns_is_taken_out_of_the_geometry() -> None:
    out = np.empty((3, 3))
    c, s = math.cos(0.3), math.sin(0.3)
    for small, lost in ((0.01, 1), (0.05, 0)):
        R = np.array([[c, -s], [s, c]])
        geometry = np.diag([0.0, 0.0, 4.0])
        geometry[:2, :2] = R @ np.diag([small, 0.9]) @ R.T
        geometry[0, 2] = geometry[2, 0] = 0.02
        count, along = observable(geometry, 0.01, CONFIG.uncertainty.pose.noisy, out)
        assert count == lost
        assert np.linalg.eigvalsh(out).min() > -1e-12
        values = np.linalg.eigvalsh(out[:2, :2])
        np.testing.assert_allclose(values, [max(small - 0.02, 0.0), 0.88], atol=1e-12)
        if lost:
            assert abs(math.sin(along - 0.3)) < 1e-9


def test_innovations_have_the_nis_of_prior_and_match_together() -> None:
    rng = np.random.default_rng(5)
    prior, data = np.diag([0.02**2, 0.01**2, 0.01**2]), np.diag([4e4, 1e4, 9e4])
    data[0, 2] = data[2, 0] = 1e4
    for share in (1.0, 0.25):
        R = share * np.linalg.inv(data)
        gain = np.linalg.solve(data + np.linalg.inv(prior), data)
        root = np.linalg.cholesky(prior + R)
        values = [
            innovation(prior, prior, data, gain @ root @ rng.normal(size=3), share, (0.0, 0.0))[0]
            for _ in range(3000)
        ]
        assert np.mean(values) == pytest.approx(3.0, abs=0.2)


def corrected(
    odometry_noise: OdometryNoise, rng: np.random.Generator, given: Float | None, true: Float
) -> float | None:
    """One step of 0.2 m whose odometry errs by ``true`` (3,) standard deviations; its NIS."""
    before = Odometry(stamp_ns=0, T_odom_robot=np.zeros(3))
    now = Odometry(
        stamp_ns=200_000_000,
        T_odom_robot=np.array([0.2, 0.0, 0.05]),
        increment_covariance=given,
    )
    prediction = odometry_noise.predict(np.zeros(3), before, now)
    match = np.diag([1e-3, 1e-3, 5e-4]) ** 2
    share = odometry_noise.noise_share(SIGMA_M)
    information = np.linalg.inv(match) * share  # what the reward's curvature says
    e = true * rng.normal(size=3) + np.sqrt(np.diag(match)) * rng.normal(size=3)
    gain = np.linalg.solve(information + np.linalg.inv(prediction.prior), information)
    odometry_noise.learn(
        prediction,
        matched(information, prediction.T_map_robot + gain @ e),
        SIGMA_M,
    )
    return odometry_noise.nis


@pytest.mark.parametrize("stated", [None, 0.3, 1.0, 1.8])
def test_scales_of_odometry_are_found_whatever_is_stated(stated: float | None) -> None:
    """``stated`` times the true standard deviations, or nothing: the NIS settles near 3."""
    true = np.array([0.01, 0.006, 0.012])
    given = None if stated is None else np.diag((stated * true) ** 2)
    odometry_noise, rng = OdometryNoise.of_beams(CONFIG), np.random.default_rng(6)
    values = [corrected(odometry_noise, rng, given, true) for _ in range(1200)]
    settled = np.array([v for v in values[400:] if v is not None])
    assert 0.6 < settled.mean() / 3.0 < 1.6
    if stated == 0.3:
        assert odometry_noise.scales[0] > 4.0


def test_a_slip_of_two_scans_goes_on_for_some_tenths_of_a_second() -> None:
    """Wheels that stand while somebody turns the robot by 1 rad/s, seen at 37.5 Hz; and at 2 Hz."""
    step, turned_rad = 1.0 / 37.5, np.array([0.0, 0.0, 1.0 / 37.5])

    def told(slips: int, seconds: float, rest: int = 0) -> float:
        """Deviation of the heading, rad, that the next prediction has by itself."""
        noise, at = OdometryNoise.of_beams(CONFIG), 0
        before = Odometry(stamp_ns=0, T_odom_robot=ZERO, increment_covariance=np.eye(3) * 1e-6)
        for k in range(slips + rest + 1):
            at += round(seconds * 1e9)
            now = dataclasses.replace(before, stamp_ns=at)
            prediction, before = noise.predict(ZERO, before, now), now
            pose = turned_rad if k < slips else ZERO
            noise.note_slip(prediction, matched(np.eye(3), pose))
        return math.sqrt(float(prediction.covariance[2, 2]))

    quiet = told(0, step)
    assert told(1, step) == quiet  # one alone may be a match that is wrong
    assert told(2, step) == pytest.approx(turned_rad[2], rel=0.15)
    assert quiet < told(2, step, rest=8) < turned_rad[2]
    assert told(2, step, rest=75) == pytest.approx(quiet, rel=0.01)
    assert told(2, 0.5) == told(0, 0.5)


def test_nees_is_right_when_the_errors_are_what_the_belief_was_told() -> None:
    """A toy: odometry with known Gaussian odometry_noise and nothing seen. NEES / 3 is 1."""
    rng = np.random.default_rng(7)
    values = []
    increment = np.array([0.2, 0.0, 0.1])
    Q = np.diag([0.01**2, 0.005**2, 0.01**2])
    root = np.linalg.cholesky(Q)
    for _ in range(300):
        pose_covariance, estimate, truth = PoseCovariance(CONFIG), np.zeros(3), np.zeros(3)
        for _ in range(20):
            c, s = math.cos(estimate[2]), math.sin(estimate[2])
            R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            predicted = se2.compose(estimate, increment)
            prediction = Prediction(
                T_map_robot=predicted,
                increment=increment,
                covariance=R @ Q @ R.T,
                twist=np.zeros(3),
                elapsed=0.2,
            )
            blind = matched(np.zeros((3, 3)), predicted)
            pose_covariance.update(estimate, prediction, blind, None)
            estimate = predicted
            truth = se2.compose(truth, increment + root @ rng.normal(size=3))
        e = estimate - truth
        e[2] = se2.wrap(float(e[2]))
        values.append(e @ np.linalg.solve(pose_covariance.covariance, e))
    assert np.mean(values) / 3.0 == pytest.approx(1.0, abs=0.15)


def standing(shared_m: float, in_view: float) -> tuple[Float, Float]:
    """Covariances of a robot that stands and sees the same surfaces, after 300 and 600 scans."""
    geometry = np.diag([0.5, 0.5, 4.0])
    pose_covariance = PoseCovariance(ShuntingConfig())
    residuals = seen(geometry, in_view=in_view, shared=20.0 * shared_m**2)
    still, match = moved(0.002, 0.002, 0.001), matched(1e5 * geometry)
    out = []
    for _ in range(2):
        for _ in range(300):
            pose_covariance.update(ZERO, still, match, residuals)
        out.append(pose_covariance.covariance.copy())
    return out[0], out[1]


def test_shared_residuals_widen_the_belief_and_standing_still_does_not() -> None:
    sizes = {}
    for shared_m in (0.0, 0.005):
        settled, later = standing(shared_m, in_view=75.0)
        np.testing.assert_allclose(later, settled, rtol=0.05, atol=1e-12)
        sizes[shared_m] = float(settled[0, 0])
    assert sizes[0.005] > 3.0 * sizes[0.0]


def test_errors_of_surfaces_average_out_over_those_in_view() -> None:
    """Five times fewer of them: five times the variance, but for what odometry leaves."""
    room, little = (standing(0.005, in_view)[1] for in_view in (75.0, 15.0))
    assert little[0, 0] / room[0, 0] == pytest.approx(5.0, rel=0.2)
    assert little[2, 2] / room[2, 2] == pytest.approx(5.0, rel=0.2)


def test_what_is_written_blindly_keeps_odometrys_error() -> None:
    """A match to a map that was just written takes off less of it than one to an old map."""
    geometry = np.diag([0.5, 0.5, 4.0])
    left = {}
    for new in (0.0, 0.2):
        pose_covariance = PoseCovariance(ShuntingConfig())
        drive = moved(0.01, 0.01, 0.01)
        for _ in range(100):
            pose_covariance.update(ZERO, drive, matched(np.zeros((3, 3))), None)
        blind = pose_covariance.covariance[0, 0]
        fresh = 20.0 * new * np.array([0.5, 0.0, 0.5])
        residuals = seen(geometry, new=20.0 * new, new_geometry=fresh)
        pose_covariance.update(ZERO, drive, matched(1e5 * geometry), residuals)
        left[new] = pose_covariance.covariance[0, 0] / blind
        assert np.linalg.eigvalsh(pose_covariance.covariance)[0] > 0.0
    assert left[0.0] < 0.05
    assert left[0.2] == pytest.approx(2.4 * 0.2, abs=0.05)


def test_a_new_end_wall_does_not_tell_how_far_the_robot_has_come() -> None:
    """At the end of a bare corridor only what was never seen before fixes the position along it:
    odometry's error stays. An end wall of old takes it away."""
    sigma_m, steps = 0.01, 100
    drive = moved(sigma_m, sigma_m, 1e-4, elapsed=0.1)
    walls, both = np.diag([0.0, 1.0, 4.0]), np.diag([0.3, 0.7, 4.0])
    left = {}
    for new in (0.0, 1.0):  # share of the end wall that is new
        pose_covariance = PoseCovariance(ShuntingConfig())

        def see(geometry: Float, new: float, to: PoseCovariance = pose_covariance) -> None:
            fresh = seen(geometry, new_geometry=20.0 * np.array([new * geometry[0, 0], 0, 0]))
            to.update(ZERO, drive, matched(1e5 * geometry), fresh)

        for _ in range(steps):
            see(walls, 0.0)
        assert pose_covariance.unobservable == 1
        assert pose_covariance.unseen_s == pytest.approx(0.1 * steps)
        for _ in range(20):
            see(both, new)
        assert pose_covariance.unobservable == 0
        left[new] = math.sqrt(pose_covariance.covariance[0, 0]) / (sigma_m * math.sqrt(steps))
        assert math.sqrt(pose_covariance.covariance[1, 1]) < 0.02
    assert left[0.0] < 0.1
    assert left[1.0] == pytest.approx(1.0, abs=0.1)


def test_a_corridor_tells_odometrys_noise_across_it() -> None:
    """What is assumed is half of the true deviation; no match says anything along the corridor."""
    noise, rng = OdometryNoise.of_beams(ShuntingConfig()), np.random.default_rng(3)
    before = Odometry(stamp_ns=0, T_odom_robot=np.zeros(3))
    for k in range(1, 301):
        now = Odometry(stamp_ns=k * 10**8, T_odom_robot=np.array([0.05 * k, 0.0, 0.0]))
        prediction = noise.predict(np.zeros(3), before, now)
        truth = prediction.T_map_robot.copy()
        truth[1] += 0.01 * rng.normal()  # a fifth of the step; a tenth is assumed
        noise.learn(prediction, matched(np.diag([0.0, 1e8, 1e8]), truth), 0.01, along_rad=0.0)
        before = now
    assert noise.scales[0] == pytest.approx(4.0, rel=0.4)


@pytest.mark.parametrize("blind_s", [700.0, 16000.0])
def test_long_blindness_leaves_a_covariance_that_can_be(blind_s: float) -> None:
    """Faded sums come to stand at the smallest numbers there are; they must count as nothing."""
    pose_covariance = PoseCovariance(CONFIG)
    nothing = seen(np.zeros((3, 3)), 0.0, in_view=0.0)
    still, match = moved(1e-3, 1e-3, 1e-3, elapsed=0.5), matched(1e4 * np.eye(3))
    pose_covariance.update(ZERO, still, match, seen(np.eye(3), 1.0, paired=0.0))
    for _ in range(round(blind_s / still.elapsed)):
        pose_covariance.update(ZERO, still, match, nothing)
    assert np.isfinite(pose_covariance.covariance).all()
    assert pose_covariance.shared_m2 < 1e-4


def test_what_movers_carried_off_stays_in_the_map_until_a_loop_says_better() -> None:
    pose, part = PoseCovariance(CONFIG), np.diag([0.0009, 0.0016, 0.0])
    for _ in range(4):
        pose.dragged(part, 0.5 * part)
    np.testing.assert_allclose(pose.newest_drift, 4.0 * part)
    assert pose.off_m == pytest.approx(0.05 * math.sqrt(4.0))  # what is of the pose alone is not
    loop = np.diag([0.0018, 0.0032, 0.0])
    pose.known(loop)
    assert pose.off_m == pytest.approx(0.05 * math.sqrt(2.0))
    np.testing.assert_allclose(pose.covariance, loop)
    pose.dragged(ZERO33, 0.5 * part)
    np.testing.assert_allclose(pose.covariance, loop + 0.5 * part)  # the pose's, until the next
    pose.dragged(part, ZERO33)
    pose.held(corridor(20.0, 0.0).shown, 0.0, 1.0)
    assert pose.off_m < 0.07


def corridor(along: float, turn: float) -> Agreement:
    """Old surface of walls across the x axis that is turned so, and so much of it along them."""
    agreement = Agreement(CONFIG.standing)
    agreement.hold(np.array([20.0, 0.0, 0.0, along, 0.0, 40.0]), 0.2)
    agreement.turned(turn)
    return agreement


@pytest.mark.parametrize("off_m", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("turn", [0.0, 0.7, math.pi / 2.0])
def test_old_surface_holds_to_what_it_was_off_itself(off_m: float, turn: float) -> None:
    """It is trusted no further than to twice its variance, and not at all where it is off more."""
    pose, wide = PoseCovariance(CONFIG), np.diag([0.09, 0.04, 0.01])
    pose.dragged(wide, ZERO33)
    pose.held(corridor(20.0, turn).shown, 4.0, 1.0)
    assert pose.off_m == pytest.approx(math.sqrt(0.13))
    sizes = []
    for _ in range(2000):
        pose.held(corridor(20.0, turn).shown, off_m**2, 0.2)
        sizes.append(math.sqrt(pose.covariance[0, 0] + pose.covariance[1, 1]))
        assert np.linalg.eigvalsh(pose.covariance).min() > 0.0
    assert np.all(np.diff(sizes) <= 1e-9)
    assert sizes[-1] == pytest.approx(min(math.sqrt(2.0) * off_m, math.sqrt(0.13)), abs=0.02)


@pytest.mark.parametrize("turn", [0.0, 0.7, math.pi / 2.0])
def test_the_little_that_noise_shows_along_a_corridor_holds_nothing_along_it(turn: float) -> None:
    pose = PoseCovariance(CONFIG)
    pose.dragged(np.diag([0.04, 0.04, 0.01]), ZERO33)
    pose.along_rad = math.pi / 2.0 + turn
    for _ in range(500):
        pose.held(corridor(0.5, turn).shown, 0.0, 0.2)
    along = np.array([math.cos(pose.along_rad), math.sin(pose.along_rad), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    assert along @ pose.covariance @ along == pytest.approx(0.04, rel=0.01)
    assert across @ pose.covariance @ across < 1e-4


def test_one_sum_of_corrections_can_be_held_though_it_has_but_one_direction() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        pose, pull = PoseCovariance(CONFIG), rng.normal(0.0, [0.2, 0.2, 0.1])
        pose.dragged(np.multiply.outer(pull, pull), ZERO33)
        for _ in range(20):
            pose.held(corridor(10.0, float(rng.uniform(0.0, math.tau))).shown, 0.0, 0.2)
        assert np.linalg.eigvalsh(pose.covariance).min() > -1e-9
        assert np.trace(pose.covariance) < pull @ pull


@pytest.mark.parametrize(("off_m", "sure"), [(0.0, True), (0.4, False)])
def test_a_pose_is_sure_again_among_surfaces_that_were_known_before_and_no_others(
    off_m: float, sure: bool
) -> None:
    """A room that was mapped while the map was off by as much says nothing of it."""
    room, turn = World2D(arena()), Drive((0.0, 0.0, 0.0), ((0.0, 0.8, 30.0),))
    stream = frames(room, turn, rate_hz=5.0, seed=3)
    system = ShuntingSlam(CONFIG)
    before = len(stream) // 2
    for k, frame in enumerate(stream):
        if (k == 1 and off_m > 0.0) or k == before:
            variance = 0.5 * (off_m if k == 1 else 0.4) ** 2
            system._pose_covariance.dragged(np.diag([variance, variance, 1e-4]), ZERO33)
        estimate = system.update(frame.without_truth())
        assert k != before or np.trace(estimate.covariance[:2, :2]) > 0.3**2
    assert (np.trace(estimate.covariance[:2, :2]) < 0.1**2) == sure
