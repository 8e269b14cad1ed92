# SPDX-License-Identifier: Apache-2.0
"""How often is a robot at a wrong place, and sure of it? Streams of a plane world, a campaign."""
