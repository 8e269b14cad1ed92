# SPDX-License-Identifier: Apache-2.0
"""What people run: ``mobilia <verb>``, one module a verb."""
