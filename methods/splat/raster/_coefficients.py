# SPDX-License-Identifier: Apache-2.0
"""Coefficients of surfels: sixteen numbers in which a pixel costs a few operations.

Along the ray through a pixel that lies ``p`` away from the anchor, in pixels, the disc's plane is met at
``u = (U . (p, 1)) / (D . (p, 1))``, ``v`` likewise, at depth ``h / (D . (p, 1))``: the ray of a pixel is
linear in ``p``, and so are numerators and denominator. They are scaled so that alpha is
``opacity * exp(-min(u^2 + v^2, p . p))``, the second being the low-pass.

The anchor is the centre of the disc's box, or what of the image, widened by ``BEYOND``, lies nearest to
it: from a centre far outside, slopes would be multiplied by distances and the products cancel, which costs
float32 digits. It is no longer the low-pass's centre then, but that low-pass would draw nothing in the image,
and that of the anchor does not either.
"""

COLUMNS = 16
"""Numbers a surfel, float32: one vector, one line of the cache."""
U, V, D = 0, 3, 6
"""First columns of the three linear forms: slope in x, slope in y, value at the anchor."""
LOG_OPACITY = 9
"""To base two."""
HEIGHT = 10
"""h over ``NEAR``: the largest denominator at which the plane is met in front of the near plane."""
CENTRE_Z = 11
"""z-depth of the surfel's centre, metres."""
WHOLE, REST = 12, 14
"""First columns of the anchor in x and y, pixels, as it is drawn: a whole number and what is left, so that
no digits are lost far from the image's corner."""

MARGIN = 0.001
"""Pixels by which a footprint is widened against rounding."""
BEYOND = 4.0
"""Pixels from the image's edge to the furthest anchor: more than ``sqrt(log(255))``, as far as a low-pass of
opacity one reaches."""
LOG2_E = 1.4426950408889634
