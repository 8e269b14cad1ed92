# SPDX-License-Identifier: Apache-2.0
"""Films, strips and recordings of runs."""
