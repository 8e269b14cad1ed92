# SPDX-License-Identifier: Apache-2.0
"""What works on this machine, what does not, and how to get it."""
