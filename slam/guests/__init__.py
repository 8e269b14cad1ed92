# SPDX-License-Identifier: Apache-2.0
"""SLAMs from outside, behind the same protocol: to compare with on the same frames.

They are optional: ``pip install 'mobilia[guests]'``.
"""

from slam.guests.guest import Guest
from slam.guests.karto import KartoSlam
from slam.guests.kiss import KissIcpSlam

__all__ = ["Guest", "KartoSlam", "KissIcpSlam"]
