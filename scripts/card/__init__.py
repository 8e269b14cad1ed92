# SPDX-License-Identifier: Apache-2.0
"""The sensor card: the simulated scanner beside its data sheet."""
