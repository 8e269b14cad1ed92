# SPDX-License-Identifier: Apache-2.0
"""Whether the estimate can be trusted: tracking quality, relocalisation, loops."""
