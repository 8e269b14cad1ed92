# SPDX-License-Identifier: Apache-2.0
"""The drive, differential, car-like or omnidirectional: commanded twist, ramped speeds, travel.

Wheels turn exactly as commanded (a stiff motor loop) and pull the robot through tyre servos whose
force is limited by grip. So ``travel_m`` is what a perfect encoder counts, and it parts from the
true path when the robot pushes something or slips, as on a real floor. Encoder errors are the
business of ``sim.sensors.odometry.encoders``.
"""

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from sim.core.state import Record, record
from slam._jit import inner
from slam.errors import InvalidValueError
from slam.shaped import NotNegative, Positive, check

# Twist that is asked for and that the ramp has reached, m/s, rad/s; m rolled by each wheel; their
# speeds, m/s. Then the same to the left, of wheels that roll sideways too.
STATE = record(
    np.float64,
    "asked_v asked_omega v omega rolled_left rolled_right left right asked_side side rolled_side",
)


@dataclass(frozen=True, kw_only=True)
class DriveConfig:
    """Limits of a Pioneer 3-DX class robot indoors (design range: usual speed below 1.2 m/s).

    v_max, omega_max  m/s, rad/s; commands beyond are clipped
    accel, alpha      m/s2, rad/s2 of the ramp
    track             m between the wheels
    turn_radius       m, of the tightest turn of a car; 0: it turns on the spot
    sideways          whether its wheels roll sideways too (mecanum); v_max holds in any direction
    """

    v_max: Positive = 1.0
    omega_max: Positive = 1.5
    accel: Positive = 1.0
    alpha: Positive = 3.0
    track: Positive = 0.33
    turn_radius: NotNegative = 0.0
    sideways: bool = False

    def __post_init__(self) -> None:
        check(self)


@inner
def toward(value: float, target: float, step: float) -> float:
    """``value`` moved by at most ``step`` towards ``target``."""
    return value + min(max(target - value, -step), step)


@inner
def steered(v: float, omega: float, turn_radius: float) -> float:
    """``omega`` as far as wheels that steer no tighter than ``turn_radius`` m can turn; 0: all."""
    if turn_radius <= 0.0:
        return omega
    return min(max(omega, -abs(v) / turn_radius), abs(v) / turn_radius)


@inner
def ramp(drive: Record, limits: NDArray[np.float64]) -> None:
    """One tick of the ramp, and the wheel speeds that follow; ``limits`` as ``Drive.limits``."""
    speed_step, turn_step, half, turn_radius = limits
    drive.v = toward(drive.v, drive.asked_v, speed_step)
    drive.side = toward(drive.side, drive.asked_side, speed_step)
    drive.omega = steered(drive.v, toward(drive.omega, drive.asked_omega, turn_step), turn_radius)
    drive.left, drive.right = drive.v - half * drive.omega, drive.v + half * drive.omega


@inner
def roll(drive: Record, duration: float) -> None:
    """Let the wheels turn at their present speed."""
    drive.rolled_left += drive.left * duration
    drive.rolled_right += drive.right * duration
    drive.rolled_side += drive.side * duration


class Drive:
    """Ramp and wheels of the body ``robot/base``, moved on by ``sim.world.substeps``.

    state   (1,) of ``STATE``
    tyres   (3,) actuators left, right, sideways, which take the wheels' surface speeds
    limits  (4,) change of v and omega in a tick of ``tick`` s at most, half the track m, tightest
            turn m
    """

    def __init__(self, model: mujoco.MjModel, config: DriveConfig, tick: float) -> None:
        self.config = config
        self.state = np.zeros(1, STATE)
        names = ("robot/tyre_l", "robot/tyre_r", "robot/side")
        self.tyres = np.array([model.actuator(name).id for name in names], dtype=np.int64)
        self.limits = np.array(
            [config.accel * tick, config.alpha * tick, 0.5 * config.track, config.turn_radius]
        )

    def command(self, v: float, omega: float, side: float = 0.0) -> None:
        """Ask for a twist, m/s, rad/s and m/s to the left; clipped to the limits (oblique motion in
        its direction), reached by the ramp.

        ``InvalidValueError`` for ``side`` where the wheels do not roll sideways.
        """
        if not (math.isfinite(v) and math.isfinite(omega) and math.isfinite(side)):
            raise InvalidValueError(
                f"the drive command must be finite, got v={v}, omega={omega}, side={side}"
            )
        c = self.config
        if side != 0.0 and not c.sideways:
            raise InvalidValueError(f"this robot cannot drive sideways, asked for {side:g} m/s")
        if side != 0.0:
            part = min(c.v_max / math.hypot(v, side), 1.0)
            v, side = part * v, part * side
        self.state["asked_side"] = side
        self.state["asked_v"] = min(max(v, -c.v_max), c.v_max)
        self.state["asked_omega"] = min(max(omega, -c.omega_max), c.omega_max)

    @property
    def travel_m(self) -> NDArray[np.float64]:
        """(3,) m rolled by the left and the right wheel since the start, backwards negative; and to
        the left."""
        names = ("rolled_left", "rolled_right", "rolled_side")
        return np.concatenate([self.state[name] for name in names])

    def halt(self) -> None:
        """Wheels and ramp stand still; the command stays."""
        for name in ("v", "omega", "left", "right", "side"):
            self.state[name] = 0.0
