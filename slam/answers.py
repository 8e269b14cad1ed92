# SPDX-License-Identifier: Apache-2.0
"""What a SLAM answers, judged: whatever is no estimate, map or trajectory is its failure."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from slam.errors import InvalidValueError, NeedsLabelsError, NotFiniteError, SlamFailedError
from slam.estimate import Changes, Estimate, Landmarks, Raster
from slam.frames import Float, Frame
from slam.interface import (
    HasChanges,
    HasLandmarks,
    RunsAtTheEnd,
    SlamSystem,
    place_of,
    told,
)  # fmt: skip
from slam.trajectory import Trajectory

T = TypeVar("T")
MOST_M = 1e9  # m and rad, of a pose or a map's origin: the squares of errors must not overflow
LEAST_CELL_M, MOST_CELL_M = 1e-3, 1e3  # edge of a map's cell


def asked(system: SlamSystem, frame: Frame) -> Estimate:
    """One update, judged: raises ``SlamFailedError`` for whatever is no estimate of this frame."""
    with judged(system.update):
        found: object = system.update(frame)
        estimate = _of(Estimate, found)
        if estimate.stamp_ns != frame.stamp_ns:
            raise SlamFailedError(
                f"returned an estimate for {estimate.stamp_ns} ns instead of {frame.stamp_ns} ns",
                "bad",
            )
        _check_near("a pose", estimate.T_map_robot)
        return estimate


def _of(kind: type[T], found: object, none: str = "") -> T:
    """``found``, which must be of that type; ``none`` is what else may be, for the error."""
    if not isinstance(found, kind):
        raise SlamFailedError(f"returned no {kind.__name__}{none} but {found!r:.80}", "bad")
    return found


def _check_near(what: str, poses: Float) -> None:
    """``SlamFailedError`` for a place past ``MOST_M``: no picture holds it."""
    if poses.size and (far := float(np.abs(poses).max())) > MOST_M:
        raise SlamFailedError(f"returned {what} at {far:g} m or rad, past {MOST_M:g}", "bad")


def asked_map(system: SlamSystem) -> Raster | None:
    """The map now, None for none or an empty one; ``SlamFailedError`` for what no map can be."""
    with judged(system.map):
        found: object = system.map()
        if found is None:
            return None
        raster = _of(Raster, found, " or None")
        if raster.T_map_origin[2] != 0.0:
            raise SlamFailedError(
                "returned a map that does not lie along the map's axes, its origin is turned by "
                f"{raster.T_map_origin[2]} rad",
                "bad",
            )
        _check_near("a map", raster.T_map_origin)
        if not LEAST_CELL_M <= raster.resolution_m <= MOST_CELL_M:
            raise SlamFailedError(
                f"returned a map of cells of {raster.resolution_m:g} m, they may have "
                f"{LEAST_CELL_M:g} to {MOST_CELL_M:g}",
                "bad",
            )
        return raster if raster.values.size else None


def asked_landmarks(system: HasLandmarks) -> Landmarks:
    """Its landmarks now; ``SlamFailedError`` for what cannot be any."""
    with judged(system.landmarks):
        found: object = system.landmarks()
        return _of(Landmarks, found)


def asked_changes(system: HasChanges) -> Changes | None:
    """What moved lately; ``SlamFailedError`` for what cannot be that."""
    with judged(system.changes):
        found: object = system.changes()
        return None if found is None else _of(Changes, found, " or None")


def asked_trajectory(system: SlamSystem, stamps_ns: NDArray[np.int64]) -> Trajectory:
    """Its final poses, one at least for each of ``stamps_ns``; ``SlamFailedError`` otherwise."""
    with judged(system.trajectory):
        found: object = system.trajectory()
        final = _of(Trajectory, found)
        if not np.isin(stamps_ns, final.stamps_ns).all():
            raise SlamFailedError(
                f"returned {len(final)} poses and leaves out frames; it must have one for each of "
                f"the {len(stamps_ns)} updates",
                "bad",
            )
        _check_near("a final pose", final.poses)
        return final


def asked_at_end(
    system: RunsAtTheEnd, stamps_ns: NDArray[np.int64]
) -> tuple[list[Estimate], list[float]]:
    """Its estimates for ``stamps_ns`` and their processor times, s; ``SlamFailedError`` if not."""
    with judged(system.estimates_at_end):
        answers = list(system.estimates_at_end())
        estimates = [estimate for estimate, _ in answers]
        spent_s = [float(seconds) for _, seconds in answers]
        stamps = [estimate.stamp_ns for estimate in estimates]
        if stamps != stamps_ns.tolist():
            raise SlamFailedError(
                f"returned {len(stamps)} estimates; it must return one for each of the "
                f"{len(stamps_ns)} updates, in order",
                "bad",
            )
        for estimate in estimates:
            _check_near("a pose", estimate.T_map_robot)
        return estimates, spent_s


@contextmanager
def judged(method: object) -> Iterator[None]:
    """Whatever somebody's SLAM raises becomes a ``SlamFailedError`` with its outcome; what is wrong
    with its answer is told with the place of the ``method`` that gave it.

    But for ``NeedsLabelsError``: what lacks is the stream's.
    """
    try:
        yield
    except NeedsLabelsError:
        raise
    except SlamFailedError as error:
        raise SlamFailedError(f"{error.message}{place_of(method)}", error.outcome) from error
    except NotFiniteError as error:
        raise SlamFailedError(f"raised {told(error, method)}", "nan") from error
    except InvalidValueError as error:  # ours begin with the type whose field is wrong
        theirs = not str(error).startswith(("Estimate.", "Raster.", "Trajectory."))
        outcome = "raised" if theirs else "bad"
        raise SlamFailedError(f"raised {told(error, method)}", outcome) from error
    except (Exception, SystemExit) as error:
        raise SlamFailedError(f"raised {told(error, method)}") from error
