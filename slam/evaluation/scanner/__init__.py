# SPDX-License-Identifier: Apache-2.0
"""What a log says of its laser scanner: noise, rounding, lost beams, mixed pixels."""
