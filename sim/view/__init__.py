# SPDX-License-Identifier: Apache-2.0
"""Pictures of a world, in 3D and from above."""
