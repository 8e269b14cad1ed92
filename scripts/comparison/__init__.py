# SPDX-License-Identifier: Apache-2.0
"""SLAMs side by side on simulated runs: ``docs/comparing.md`` says what the folder holds."""
