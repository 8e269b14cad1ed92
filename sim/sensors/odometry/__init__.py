# SPDX-License-Identifier: Apache-2.0
"""Wheel encoders and dead reckoning."""
