# SPDX-License-Identifier: Apache-2.0
"""Poorer scanners from the scans of a better one: fewer beams, less to the sides, less far."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scripts.checked import whole
from slam.errors import InvalidValueError
from slam.frames import Frame, LaserSpec, Scan


@dataclass(frozen=True, kw_only=True)
class Part:
    """What is left of a scanner.

    name     as tables call it
    every    of so many beams one
    fov_deg  field of view about its middle, deg; None: all of it
    range_m  farther returns are none, m; None: as they are
    """

    name: str
    every: int = 1
    fov_deg: float | None = None
    range_m: float | None = None

    def __post_init__(self) -> None:
        whole("Part.every", self.every, 1)
        for name, value, least in (("fov_deg", self.fov_deg, 1.0), ("range_m", self.range_m, 0.1)):
            known = isinstance(value, (int, float)) and math.isfinite(value) and value >= least
            if value is not None and not known:
                raise InvalidValueError(
                    f"Part.{name} must be a number of at least {least}, got {value!r}"
                )

    def of(self, frames: list[Frame]) -> list[Frame]:
        """The same frames with the poorer scans, without labels; scans of one spec share one."""
        specs: dict[int, tuple[NDArray[np.int64], LaserSpec]] = {}
        out = []
        for frame in frames:
            if frame.scan is None:
                raise InvalidValueError("a Part is of frames with scans")
            spec = frame.scan.spec
            if id(spec) not in specs:
                specs[id(spec)] = self._spec(spec)
            chosen, poorer = specs[id(spec)]
            ranges = frame.scan.ranges[chosen]
            ranges[ranges > poorer.range_max] = np.inf
            scan = Scan(stamp_ns=frame.scan.stamp_ns, ranges=ranges, spec=poorer)
            out.append(replace(frame, scan=scan, labels=None))
        return out

    def _spec(self, spec: LaserSpec) -> tuple[NDArray[np.int64], LaserSpec]:
        """The beams that are left, and the spec of them."""
        chosen = np.arange(0, spec.n_beams, self.every)
        if self.fov_deg is not None:
            middle = 0.5 * (spec.angles[0] + spec.angles[-1])
            wide = 0.5 * math.radians(self.fov_deg) + 1e-9
            chosen = chosen[np.abs(spec.angles[chosen] - middle) <= wide]
            if not len(chosen):
                raise InvalidValueError(
                    f"Part.fov_deg must hold at least one of the beams, got {self.fov_deg:g} "
                    f"with one beam of {self.every}"
                )
        poorer = replace(
            spec,
            n_beams=len(chosen),
            angle_min=float(spec.angles[chosen[0]]),
            angle_increment=spec.angle_increment * self.every,
            range_max=min(self.range_m or spec.range_max, spec.range_max),
            beam_time_offsets=spec.beam_time_offsets[chosen],
        )
        return chosen, poorer
