# SPDX-License-Identifier: Apache-2.0
"""``mobilia blame``: which mover misled a SLAM, found by running the world without it."""
