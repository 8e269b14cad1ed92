# SPDX-License-Identifier: Apache-2.0
"""Following a robot on a map of cells, whatever the map: matching, uncertainty, tracking."""
