# SPDX-License-Identifier: Apache-2.0
"""``mobilia blame`` and ``shrink``: which mover misled a SLAM, and in how little of the run."""
