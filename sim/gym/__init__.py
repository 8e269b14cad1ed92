# SPDX-License-Identifier: Apache-2.0
"""The moving rooms as Gymnasium environments."""
