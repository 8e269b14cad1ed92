# SPDX-License-Identifier: Apache-2.0
"""``mobilia blame``: which mover led a SLAM astray, found by running the world without it."""
