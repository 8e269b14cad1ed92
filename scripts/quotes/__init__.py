# SPDX-License-Identifier: Apache-2.0
"""Measured numbers on pages: results files in docs/results, and the pages that quote them."""
