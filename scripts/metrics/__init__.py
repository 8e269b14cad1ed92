# SPDX-License-Identifier: Apache-2.0
"""One row a metric (``table``): what it is, how it is computed, how every command shows it."""
