# SPDX-License-Identifier: Apache-2.0
"""The rules of ``graycard-0``, by which every score here is made.

*Views.* Only test views are scored.

*Mask.* A pixel is judged where the truth sees an object (``object_id > 0``); for ``base_color`` it
must not be the surface of a light, which has no colour to be found. Nothing is multiplied by the
mask: pixels outside do not enter any sum or count, nor, through filters, any neighbour.

*Gauge.* A scale of albedo is fitted on the training views only, once per scene, by least squares in
linear light over the mask, and is printed in the score. Raw, scalar and per-channel are three
metrics, always shown together.

*Colour space.* ``base_color`` PSNR is in linear light. Radiance, and all SSIM and FLIP, are compared
as displayed: ``srgb_encode(radiance * exposure)`` with the one exposure of the scene.

*Pooling.* PSNR: mean square error per view, mean over views, PSNR of that mean (the mean of PSNRs
would be higher, by Jensen). All else: value per view, mean over views. Lights: mean over matched
pairs; in the position each light without a partner counts as one that is a whole scene away (as in the
OSPA metric of Schuhmacher, Vo and Vo 2008, order 1, cut off at the diameter), so that neither few
good guesses nor very many pay.

*Faults.* A metric whose layer is missing in a view, of wrong size, not finite or unreadable has
failed, with the reason; a view is never left out and nothing is put in its place. A layer that no
view has is "not provided". A file that cannot be read may hold any layer, so it fails all images.
"""

PROTOCOL = "graycard-0"
"""Name and version of these rules; a change to any of them is a new version."""
