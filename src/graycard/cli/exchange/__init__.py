# SPDX-License-Identifier: Apache-2.0
"""The verbs that exchange captures and pictures with other programs."""
