# SPDX-License-Identifier: Apache-2.0
"""Scan matching on the map, Eq. (13): score, climb, and searches by branch and bound."""
