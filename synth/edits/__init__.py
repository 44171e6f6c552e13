# SPDX-License-Identifier: Apache-2.0
"""Changes of a scene whose pictures are known: other lights, or an object put in."""
