# SPDX-License-Identifier: Apache-2.0
"""One module a verb of the console command: parse, call, print."""
