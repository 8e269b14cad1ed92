# SPDX-License-Identifier: Apache-2.0
"""The same drive in other versions of a room: twins, and rooms without one mover."""
