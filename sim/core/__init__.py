# SPDX-License-Identifier: Apache-2.0
"""What the parts of the world stand on: seeds, random draws, MuJoCo's step, bodies, clearances."""
