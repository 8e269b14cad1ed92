# SPDX-License-Identifier: Apache-2.0
"""SLAMs from outside, behind the same protocol: to compare with on the same frames.

KISS-ICP and Karto are optional: ``pip install 'mobilia[guests]'``. Any other joins over a pipe.
"""

from slam.guests.guest import Guest
from slam.guests.karto import KartoSlam
from slam.guests.kiss import KissIcpSlam
from slam.guests.pipe import Limits, PipeSlam, guarded, limited

__all__ = ["Guest", "KartoSlam", "KissIcpSlam", "Limits", "PipeSlam", "guarded", "limited"]
