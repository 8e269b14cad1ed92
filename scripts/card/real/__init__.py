# SPDX-License-Identifier: Apache-2.0
"""Scanners of real logs beside simulated ones, measured by the same code."""
