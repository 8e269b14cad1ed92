# SPDX-License-Identifier: Apache-2.0
"""The climb to the pose where observations overlap the map most: in one kernel, as one scan takes
it, from where blurred observations lead and with a weight that falls with the match.
"""

import math
from typing import Any, NamedTuple

from slam._jit import inner, uncounted
from slam.arrays import Float
from slam.frontend.odometry_prior import inverse, turn
from slam.tracker.cells import Field
from slam.tracker.matching.score import Reward, Seen, evaluated

SCRATCH = (19, 3)  # shape of the room that a climb works in: of ``refine``, and two matrices


class Climb(NamedTuple):
    """How the optimum is climbed to; fields as in ``ClimbConfig``."""

    steps: int
    enough: float
    damping: float
    damping_falls: float
    damping_grows: float
    damping_least: float
    damping_again: float
    damping_most: float


@inner
def _prior(pose: Float, prediction: Float, precision: Float, slope: Float) -> float:
    """-1/2 e' P^-1 e with e = pose - prediction (heading wrapped); its gradient in ``slope``."""
    ex, ey = pose[0] - prediction[0], pose[1] - prediction[1]
    et = pose[2] - prediction[2]
    et -= math.tau * math.floor(et / math.tau + 0.5)
    for k in range(3):
        slope[k] = -(precision[k, 0] * ex + precision[k, 1] * ey + precision[k, 2] * et)
    return float(0.5 * (slope[0] * ex + slope[1] * ey + slope[2] * et))


@inner
def _solve(H: Float, g: Float, damping: float, step: Float) -> None:
    """(H + damping diag H) step = g for a positive definite 3 x 3 H, by Cholesky."""
    grow = 1.0 + damping
    l00 = math.sqrt(H[0, 0] * grow)
    l10, l20 = H[1, 0] / l00, H[2, 0] / l00
    l11 = math.sqrt(max(H[1, 1] * grow - l10 * l10, 1e-12))
    l21 = (H[2, 1] - l20 * l10) / l11
    l22 = math.sqrt(max(H[2, 2] * grow - l20 * l20 - l21 * l21, 1e-12))
    a = g[0] / l00
    b = (g[1] - l10 * a) / l11
    c = (g[2] - l20 * a - l21 * b) / l22
    step[2] = c / l22
    step[1] = (b - l21 * step[2]) / l11
    step[0] = (a - l10 * step[1] - l20 * step[2]) / l00


@inner
def refine(  # noqa: C901, PLR0913 (kernel)
    field: Field,
    reward: Reward,
    climb: Climb,
    seen: Seen,
    pose: Float,
    prediction: Float,
    precision: Float,
    tau: float,
    information: Float,
    scratch: Float,
) -> tuple[float, float, float, float]:
    """Climb to the maximum of tau * reward - 1/2 Mahalanobis^2 from ``pose`` (changed in place).

    Newton's method with Levenberg damping; a step is taken only if it rises, but for the last, tiny
    one. The slope of the reward along observed surfaces is left out of it: there it only says where
    the map is older, which would hold a robot back in a corridor. Returns reward, prior, the weight
    of matched observations and that of unmatched ones without weight, and leaves the data's
    information (without tau and prior) in ``information``, all as before the last step. What is in
    the first 13 rows of ``scratch`` does not matter.
    """
    gradient, along, slope, step = scratch[0], scratch[1], scratch[2], scratch[3]
    trial, trial_gradient, trial_along = scratch[4], scratch[5], scratch[6]
    trial_information, H = scratch[7:10], scratch[10:13]
    rewarded, matched, absent = evaluated(field, reward, seen, pose, gradient, along, information)
    prior = _prior(pose, prediction, precision, slope)
    damping = climb.damping
    for _ in range(climb.steps):
        for a in range(3):
            for b in range(3):
                H[a, b] = tau * information[a, b] + precision[a, b]
            slope[a] += tau * (gradient[a] - along[a])
        _solve(H, slope, damping, step)
        if step[0] * slope[0] + step[1] * slope[1] + step[2] * slope[2] < climb.enough:
            for a in range(3):
                pose[a] += step[a]  # so little that it needs no look at the score
            break
        for a in range(3):
            trial[a] = pose[a] + step[a]
        trial_rewarded, trial_matched, trial_absent = evaluated(
            field, reward, seen, trial, trial_gradient, trial_along, trial_information,
        )  # fmt: skip
        older = along[0] * step[0] + along[1] * step[1] + along[2] * step[2]
        trial_prior = _prior(trial, prediction, precision, step)
        if tau * (trial_rewarded - rewarded - older) + trial_prior > prior:
            rewarded, prior = trial_rewarded, trial_prior
            matched, absent = trial_matched, trial_absent
            for a in range(3):  # element by element: array assignment triples the compile time
                pose[a], gradient[a], along[a] = trial[a], trial_gradient[a], trial_along[a]
                for b in range(3):
                    information[a, b] = trial_information[a, b]
            damping = max(climb.damping_falls * damping, climb.damping_least)
        else:
            damping = max(climb.damping_grows * damping, climb.damping_again)
            if damping > climb.damping_most:
                break
        _prior(pose, prediction, precision, slope)
    return rewarded, prior, matched, absent


@inner
def blur(  # noqa: PLR0913 (kernel)
    seen: Seen, covariance: Float, place: float, least: float, most: float, every: int, out: Seen
) -> bool:
    """Fill ``out`` with one of ``every`` so many, smeared by a pose's (3, 3) ``covariance``.

    That one is in the robot frame. False, and ``out`` is not to be used, where it smears none of
    them by more than ``least``; the smear is shrunk to ``most``. Both are sums of two variances,
    m^2, and so is ``place``, that of the prior's position.
    """
    xx, xy, xt = covariance[0, 0], covariance[0, 1], covariance[0, 2]
    yy, yt, tt = covariance[1, 1], covariance[1, 2], covariance[2, 2]
    farthest = 0.0
    for k in range(len(seen.points)):
        x, y = seen.points[k, 0], seen.points[k, 1]
        farthest = max(farthest, x * x + y * y)
    if 2.0 * (place + farthest * tt) < least:  # (a + b)^2 <= 2 (a^2 + b^2)
        return False
    blurred = False
    for m in range(len(out.points)):
        k = m * every
        x, y = seen.points[k, 0], seen.points[k, 1]
        ttx, tty = tt * x, tt * y
        a = xx - 2.0 * xt * y + tty * y
        b = xy + xt * x - yt * y - ttx * y
        d = yy + 2.0 * yt * x + ttx * x
        blurred |= a + d > least
        share = min(1.0, most / max(a + d, 1e-12))
        out.points[m, 0], out.points[m, 1] = x, y
        out.covariances[m, 0] = seen.covariances[k, 0] + a * share
        out.covariances[m, 1] = seen.covariances[k, 1] + b * share
        out.covariances[m, 2] = seen.covariances[k, 2] + d * share
        out.shares[m] = seen.shares[k] * every
        out.tangents[m, 0], out.tangents[m, 1] = seen.tangents[k, 0], seen.tangents[k, 1]
        out.facings[m], out.weights[m] = seen.facings[k], seen.weights[k]
    return blurred


class Numbers(NamedTuple):
    """Of a climb, in an order that kernels know: a named tuple takes longer on its way to one.

    reward, climb  of ``Reward`` and ``Climb``, plain too
    full, exponent, tempered, least_weight  how the weight of the reward falls with the match
    least, most    of ``blur``
    """

    reward: tuple[Any, ...]
    climb: tuple[Any, ...]
    full: float
    exponent: float
    tempered: float
    least_weight: float
    least: float
    most: float


@uncounted
def climbed(  # noqa: PLR0913 (kernel)
    field: tuple[Any, ...], plain: tuple[Any, ...], seen_arrays: tuple[Any, ...], amount: float,
    prediction: Float, prior: Float, every: int, few: tuple[Any, ...], pose: Float,
    information: Float, scratch: Float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Climb from ``pose``, which is changed, with observations of that ``amount`` in all, if any.

    ``every`` > 0: from where every so manieth of them leads, blurred by the ``prior``'s covariance;
    0: the prior is given by its inverse. ``field`` of ``Field``, ``plain`` of ``Numbers``,
    ``seen_arrays`` of ``Seen``. ``few`` (``Seen``) and ``scratch`` (``SCRATCH``): room to work in.
    Returns weight of the reward, matched and overlapped share, and score.
    """
    of, reward, climb = Field(*field), Reward(*plain[0]), Climb(*plain[1])
    _, _, full, exponent, enough, least_weight, least, most = plain
    seen = Seen(*seen_arrays)
    precision, blurred = scratch[13:16], scratch[16:19]
    if every > 0:
        inverse(prior, precision)
        turn(prior, -prediction[2], blurred)
        m = -(-len(seen.points) // every)
        those = Seen(few[0][:m], few[1][:m], few[2][:m], few[3][:m], few[4][:m], few[5][:m])
        if blur(seen, blurred, prior[0, 0] + prior[1, 1], least, most, every, those):
            refine(
                of, reward, climb, those, pose, prediction, precision, full, information, scratch
            )
    else:
        for a in range(3):
            for b in range(3):
                precision[a, b] = prior[a, b]
    information[:] = 0.0
    tau, matched, overlapped, score = full, 0.0, 0.0, -math.inf
    while amount > 0.0:
        rewarded, of_prior, count, absent = refine(
            of, reward, climb, seen, pose, prediction, precision, tau, information, scratch
        )
        overlapped = count / amount
        matched = count / (amount - absent) if count > 0.0 else 0.0
        score = full * rewarded + of_prior
        tempered = max(full * matched**exponent, least_weight)
        if tau < full or tempered > enough * tau:
            break
        tau = tempered
    return tau, matched, overlapped, score
