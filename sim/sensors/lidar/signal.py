# SPDX-License-Identifier: Apache-2.0
"""From the geometry under a laser spot to the value a scanner sends.

A spot is several rays. Rays at about the same distance make one pulse whose energy is the sum of
weight, reflectivity and cosine of incidence. The first pulse that carries the energy needed at its
distance (TD fig. 4-2) is the one that counts (TL p19); if more energy comes back from within the
length of a pulse behind it, the value lies anywhere between the
two (TL p110-111): a mixed pixel. What a pane lets through and what it mirrors share
the energy as Fresnel's two faces of n = 1.5 do (Schlick's approximation; inferred, as is all about
glass: no source gives numbers for this device). The counter's value is then corrected by the
unit's own tables and rounded to the code of the range mode (TL p113). TD and TL are the documents
of the LMS-221 (``sim.sensors.lidar.models.lms221``), whose receiver this is.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sim.sensors.lidar import columns as col
from sim.sensors.lidar.fan import row_of
from slam._jit import inner, njit
from slam.frames import Float

Int = NDArray[np.int64]
Bool = NDArray[np.bool_]

NEEDED_STEP = 0.005  # m, of the table of needed reflectivity
ERROR_STEP = 0.1  # m, of the table of the systematic error
SAME_PULSE = 0.1  # m between rays of one pulse; inferred
SAME_SURFACE = 0.5  # m, the same where both hit one thing: an oblique wall; inferred
RETURN_COS = math.cos(math.radians(5.0))  # a mirror answers only that near its normal; inferred
GLASS_AT_NORMAL = 0.08  # share of the energy a pane mirrors: two faces of n = 1.5 (Schlick)
POLISHED_SHARE = 0.9  # share that a polished face mirrors; inferred
POLISHED_DIFFUSE = 0.005  # what is left of its reflectivity away from its normal; inferred


@inner
def _pane_share(cos: float) -> float:
    """Share of the energy that a pane mirrors."""
    u = 1.0 - min(cos, 1.0)
    return GLASS_AT_NORMAL + (1.0 - GLASS_AT_NORMAL) * u * u * u * u * u


@inner
def _sort_rays(distances: Float, order: Int, count: int) -> None:
    for i in range(count):
        order[i] = i
    for i in range(1, count):
        k, j = order[i], i
        while j > 0 and distances[order[j - 1]] > distances[k]:
            order[j] = order[j - 1]
            j -= 1
        order[j] = k


@inner
def _next_pulse(
    distances: Float, energies: Float, surfaces: Int, order: Int, first: int
) -> tuple[int, float, float, int]:
    """(row after the pulse that begins at ``first``, its energy, range, strongest ray)."""
    energy, moment, strongest = 0.0, 0.0, order[first]
    row = first
    while row < order.size:
        k = order[row]
        if not distances[k] < math.inf:
            break
        if row > first:
            before = order[row - 1]
            alike = surfaces[k] == surfaces[before]
            if distances[k] - distances[before] > (SAME_SURFACE if alike else SAME_PULSE):
                break
        energy += energies[k]
        moment += energies[k] * distances[k]
        if energies[k] > energies[strongest]:
            strongest = k
        row += 1
    return row, energy, moment / energy if energy > 0.0 else distances[strongest], strongest


@inner
def detect(  # noqa: PLR0913 (kernel)
    distances: Float,
    energies: Float,
    surfaces: Int,
    order: Int,
    needed: Float,
    chance: float,
    pulse: float,
) -> tuple[float, int, bool]:
    """(range m, inf for none; strongest ray, -1; mixed) of one beam.

    distances, energies, surfaces  (k,) of each ray, inf for none
    order                          (k,) room for their order
    needed                         energy needed against distance, every ``NEEDED_STEP`` m
    chance                         0..1, where between two surfaces a mixed pixel falls
    pulse                          m between surfaces that mix; 0: none do
    """
    _sort_rays(distances, order, order.size)
    row = 0
    while row < order.size and distances[order[row]] < math.inf:
        row, energy, place, strongest = _next_pulse(distances, energies, surfaces, order, row)
        if energy <= 0.0 or energy < needed[row_of(place / NEEDED_STEP, needed.size - 1)]:
            continue
        if pulse > 0.0 and row < order.size and distances[order[row]] < math.inf:
            _, behind, far, _ = _next_pulse(distances, energies, surfaces, order, row)
            if behind > energy and far - place < pulse:
                return place + chance * (far - place), strongest, True
        return place, strongest, False
    return math.inf, -1, False


@inner
def receive(  # noqa: PLR0913, PLR0915 (kernel)
    hits: tuple[Float, Int, Float],
    mirrored: tuple[Float, Int, Float],
    surface: tuple[Float, Bool],
    weights: Float,
    switches: tuple[bool, bool, float],
    needed: Float,
    chances: Float,
    out: tuple[Float, Int, Bool],
) -> None:
    """What the receiver triggers on, for every beam of a scan.

    A ray that meets a pane near its normal comes back; else it goes on with what the pane lets
    through, both ways. What pane or polished face mirror is one ray more.

    hits      (layers, n, k) each: ranges m, inf for none; candidate, -1; |cos|
    mirrored  (n,) each, likewise, of what panes and polished faces mirror; (0,) for not at all
    surface   (candidates + 1,) each: reflectivity; polished. The last, index -1, is for no hit
    weights   (k,) of the rays
    switches  reflectivity, incidence; m of a pulse within which surfaces mix, 0 for not at all
    out       (3, n) distance m, that of the middle ray, |cos|; (n,) candidate; (2, n) mixed, ghost
    """
    ranges, found, cos_of = hits
    reflectivity, polished = surface
    by_reflectivity, by_incidence, pulse = switches
    places, seen, marks = out
    k_rays, bounces, panes = weights.size, mirrored[0].size > 0, ranges.shape[0] > 1
    count = k_rays + (1 if bounces else 0)
    distances, energies, cosines = np.empty(count), np.empty(count), np.empty(count)
    surfaces, order = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    for i in range(ranges.shape[1]):
        share, total, moment, strongest, rays = 0.0, 0.0, 0.0, 0, k_rays
        low, high, alike = math.inf, -math.inf, True
        for k in range(k_rays):
            x, j, cos, through = ranges[0, i, k], found[0, i, k], cos_of[0, i, k], 1.0
            back = reflectivity[j] if by_reflectivity else 1.0
            if panes and ranges[1, i, k] < x:
                pane_cos = cos_of[1, i, k]
                if pane_cos >= RETURN_COS:
                    x, j, cos, back = ranges[1, i, k], found[1, i, k], pane_cos, 1.0
                else:
                    part = _pane_share(pane_cos)
                    share = part if k == 0 else share
                    through = (1.0 - part) * (1.0 - part)
            elif polished[j] and cos < RETURN_COS:
                share = POLISHED_SHARE if k == 0 else share
                back *= POLISHED_DIFFUSE
            energy = weights[k] * through * back * (cos if by_incidence else 1.0)
            distances[k], surfaces[k], cosines[k], energies[k] = x, j, cos, energy
            low, high, alike = min(low, x), max(high, x), alike and j == surfaces[0]
            total, moment = total + energy, moment + energy * x
            strongest = k if energy > energies[strongest] else strongest
        if bounces and share > 0.0 and mirrored[1][i] >= 0:
            j, cos = mirrored[1][i], mirrored[2][i]
            distances[k_rays], surfaces[k_rays], cosines[k_rays] = mirrored[0][i], j, cos
            back = reflectivity[j] if by_reflectivity else 1.0
            energies[k_rays] = share * share * back * (cos if by_incidence else 1.0)
            rays += 1
        place, ray, mixed = math.inf, -1, False
        if rays == k_rays and high - low <= (SAME_SURFACE if alike else SAME_PULSE):
            # Surely one pulse, so that no order is needed; most beams are.
            middle = moment / total if total > 0.0 else math.inf
            if total > 0.0 and total >= needed[row_of(middle / NEEDED_STEP, needed.size - 1)]:
                place, ray = middle, strongest
        elif rays > 1 or distances[0] < math.inf:
            chance = chances[i] if pulse > 0.0 else 0.0  # none are drawn where nothing mixes
            place, ray, mixed = detect(
                distances[:rays], energies, surfaces, order[:rays], needed, chance, pulse
            )
        places[col.PLACE, i], places[col.MIDDLE, i] = place, distances[0]
        places[col.COSINE, i] = cosines[ray] if ray >= 0 else math.nan
        seen[i] = surfaces[ray] if ray >= 0 else -1
        marks[col.MIXED, i], marks[col.GHOST, i] = mixed, ray == k_rays


@inner
def measure(hits: tuple[Float, Int, Float], out: tuple[Float, Int, Bool]) -> None:
    """As ``receive`` for a ruler: one ray that always comes back."""
    ranges, found, cos_of = hits
    places, seen, marks = out
    for i in range(ranges.shape[1]):
        places[col.PLACE, i] = places[col.MIDDLE, i] = ranges[0, i, 0]
        places[col.COSINE, i], seen[i] = cos_of[0, i, 0], found[0, i, 0]
        marks[col.MIXED, i] = marks[col.GHOST, i] = False


@inner
def _correction(error: tuple[Float, float], place: float, brightness: float) -> float:
    """Systematic error of the unit at a distance, for a reflectivity."""
    by_range, by_reflectivity = error
    bin_ = row_of(place / ERROR_STEP, by_range.size - 2)
    part = place / ERROR_STEP - bin_
    smooth = float(by_range[bin_] * (1.0 - part) + by_range[bin_ + 1] * part)
    return smooth + by_reflectivity * (2.0 * min(max(brightness, 0.0), 1.0) - 1.0)


@inner
def send(  # noqa: C901, PLR0913 (kernel)
    received: tuple[Float, Int],
    reflectivity: Float,
    owner: Int,
    error: tuple[Float, float],
    draws: tuple[Float, Float],
    steps: tuple[float, float, float, float],
    bands: Float,
    errors: tuple[float, float],
    out: tuple[NDArray[np.float32], NDArray[np.int32]],
) -> None:
    """Counter, corrections, rounding: the values sent and whose they are.

    received      (3, n) and (n,) of ``receive``
    reflectivity  (candidates + 1,); ``owner`` (2, candidates + 1); -1 for no hit
    draws         standard normal; 0..1 against the share of lost values; (n,) where needed
    error         of ``error_function``; (0,) for none
    steps         m: of the counter and of the code, 0 for continuous; least and largest range
    bands         of the noise; (0, 3) for none
    errors        share of lost values; what no return becomes, NaN or inf
    out           (n,) ranges m; (2, n) whose
    """
    places, seen = received
    ranges, whose = out
    counter, unit, least, limit = steps
    normal, lost = draws
    rate, none = errors
    for i in range(ranges.size):
        place, j = places[col.PLACE, i], seen[i]
        whose[col.GEOM_ID, i], whose[col.BODY_ID, i] = owner[col.GEOM_ID, j], owner[col.BODY_ID, j]
        if rate > 0.0 and lost[i] < rate:
            ranges[i] = math.nan
            continue
        if j < 0:
            ranges[i] = none
            continue
        if place < least:
            ranges[i] = math.nan
            continue
        value = place
        if len(bands) > 0:
            band = 0
            while band < len(bands) - 1 and place > bands[band, col.UP_TO]:
                band += 1
            noise = bands[band, col.SIGMA] + bands[band, col.SIGMA_PER_M] * place
            value = max(place + noise * normal[i], 0.0)
        if counter > 0.0:
            value = math.floor(value / counter + 0.5) * counter
        if error[0].size > 0:
            value = max(value + _correction(error, place, reflectivity[j]), 0.0)
        if unit > 0.0:
            value = math.floor(value / unit + 0.5) * unit
        if value > limit + 1e-9 or place > limit:  # the code itself is no round number
            value = math.inf
        ranges[i] = value


@njit
def scan(  # noqa: PLR0913 (kernel)
    hits: tuple[Float, Int, Float],
    mirrored: tuple[Float, Int, Float],
    surface: tuple[Float, Bool, Int],
    receiver: tuple[bool, Float, tuple[bool, bool, float], Float],
    sender: tuple[tuple[Float, float], tuple[float, float, float, float], Float],
    errors: tuple[float, float],
    draws: tuple[Float, Float, Float],
    room: tuple[Float, Int, Bool],
    out: tuple[NDArray[np.float32], NDArray[np.int32]],
) -> None:
    """``receive`` or ``measure``, then ``send``.

    surface   reflectivity, polished, owner
    receiver  whether it is a ruler; weights, switches, needed
    sender    error, steps, bands
    draws     chances of mixed pixels, normal noise, chances of a loss
    room      what ``receive`` fills
    """
    ruler, weights, switches, needed = receiver
    if ruler:
        measure(hits, room)
    else:
        receive(hits, mirrored, surface[:2], weights, switches, needed, draws[0], room)
    error, steps, bands = sender
    send(room[:2], surface[0], surface[2], error, draws[1:], steps, bands, errors, out)
