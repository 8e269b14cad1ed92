# SPDX-License-Identifier: Apache-2.0
"""Import Numba without the settings of the working folder.

Numba reads ``.numba_config.yaml`` there, now and at every compilation. That file can say where
compiled code is loaded from, and Numba loads that with pickle: a folder of somebody else's data
could so run code. ``NUMBA_*`` variables of the environment count as ever. Its error messages have
no colours: it writes one for each overload that it tries and drops, a thirtieth of a cold start.
"""

from __future__ import annotations

import os
from contextlib import chdir, nullcontext
from pathlib import Path

os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
with chdir(os.sep) if Path(".numba_config.yaml").exists() else nullcontext():
    import numba.core.config
numba.core.config._config_fname = os.devnull  # is no regular file: nothing is read from it
