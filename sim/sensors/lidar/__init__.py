# SPDX-License-Identifier: Apache-2.0
"""Scanners: models, casting, signal, receiver."""
