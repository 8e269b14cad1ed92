# SPDX-License-Identifier: Apache-2.0
"""From the map of a robot to a plan of its building."""
