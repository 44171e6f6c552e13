# SPDX-License-Identifier: Apache-2.0
"""The plan of a scene from above."""
