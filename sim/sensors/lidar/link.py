# SPDX-License-Identifier: Apache-2.0
"""What reaches the computer by the LMS-221's serial line, and what is lost.

10 bits a byte; the device measures on while it sends, and the next scan sent is
the first that begins after the last byte has left. Telegram sizes are TL table 10-16. Lost scans
computed that way are those printed in TL table 10-17 for 9.6 and 38.4 kBd in all three modes of
whole scans; 19.2 kBd is inferred from the same rule. At 500 kBd (RS 422) nothing is lost: at most
508 bytes leave during a turn of the mirror (TL p22), so telegrams overlap with measuring.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from types import MappingProxyType

from sim.sensors.lidar.models.lms221 import TURNS_PER_S, Lms221Config
from slam.errors import InvalidValueError
from slam.frames import NS_PER_S, Frame
from slam.frontend.odometry_steps import MotionSum
from slam.shaped import check

BITS_PER_BYTE = 10  # TL 4.1
BYTES_PER_TURN = 508  # TL p22, at 500 kBd
BAUD_RATES = (9_600, 19_200, 38_400, 500_000)
TELEGRAM_BYTES = MappingProxyType({1.0: 372, 0.5: 732, 0.25: 812})  # TL table 10-16


@dataclass(frozen=True, kw_only=True)
class SerialLink:
    """The line between scanner and computer.

    baud    9600 (as delivered), 19200, 38400 (the ROS driver's default) or 500000
    config  how the scanner is set

    Raises ``InvalidValueError`` for a rate the device does not have, and for 180 degrees at 0.25,
    which leaves the device turn by turn only (TL p47): its 721 values do not fit its buffer.
    """

    baud: int
    config: Lms221Config

    def __post_init__(self) -> None:
        check(self)
        if self.baud not in BAUD_RATES:
            known = ", ".join(str(rate) for rate in BAUD_RATES)
            raise InvalidValueError(f"SerialLink.baud must be one of {known}, got {self.baud!r}")
        if self.baud < BAUD_RATES[-1] and self.is_interlaced:
            raise InvalidValueError(
                "SerialLink.config: 0.25 degrees over 180 leave the device turn by turn; below "
                "500 kBd turns of one set are lost: use 0.5 or 1 degree, or fov_deg=100"
            )

    @property
    def is_interlaced(self) -> bool:
        """Whether turns are sent one by one."""
        return self.config.resolution_deg == 0.25 and self.config.fov_deg == 180

    @property
    def telegram_bytes(self) -> int:
        """Length of one telegram; that of a single turn where turns are sent one by one."""
        return 362 if self.is_interlaced else TELEGRAM_BYTES[self.config.resolution_deg]

    @property
    def transfer_s(self) -> float:
        """Seconds a telegram takes to leave."""
        if self.baud == BAUD_RATES[-1]:
            return math.ceil(self.telegram_bytes / BYTES_PER_TURN) / TURNS_PER_S
        return self.telegram_bytes * BITS_PER_BYTE / self.baud

    @property
    def lost_scans(self) -> int:
        """Scans lost between two that are sent, best case (TL table 10-17)."""
        if self.baud == BAUD_RATES[-1]:
            return 0
        return math.floor(self.transfer_s * TURNS_PER_S / self.config.turns) + 1

    @property
    def rate_hz(self) -> float:
        """Scans that arrive per second."""
        return TURNS_PER_S / self.config.turns / (self.lost_scans + 1)

    @property
    def latency_ns(self) -> int:
        """From a scan's stamp, its earliest beam, to its arrival (TL fig. 10-9 to 10-11)."""
        measured = self.config.turns / TURNS_PER_S
        return round((measured + self.transfer_s) * NS_PER_S) - self.config.stamp_offset_ns

    def sends(self, index: int) -> bool:
        """Whether scan number ``index`` of a run is sent; the first one, 0, is."""
        return index % (self.lost_scans + 1) == 0


def over_link(frames: Iterable[Frame], link: SerialLink) -> Iterator[Frame]:
    """The frames whose scan is sent; each arrives ``link.latency_ns`` after its stamp.

    Odometry comes by a line of its own, so that none of it is lost: the covariance of an increment
    is that of all the motion since the last scan that was sent.
    """
    motion = MotionSum()
    for index, frame in enumerate(frames):
        motion.add(frame.odometry)
        if link.sends(index):
            yield motion.passed_on(frame)
