# SPDX-License-Identifier: Apache-2.0
"""Commands in the place of methods: code of others with its own packages, run confined and recorded."""
