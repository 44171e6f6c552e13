# SPDX-License-Identifier: Apache-2.0
"""The rules of ``graycard-1``, by which every score of a sheet is made.

*Views.* Only test views are scored.

*Mask.* A pixel is judged where the truth sees an object (``object_id > 0``); for ``base_color`` it
must not be the surface of a light, which has no colour to be found. Nothing is multiplied by the
mask: pixels outside do not enter any sum or count, nor, through filters, any neighbour. Where the truth
says which pixels show one surface of one colour (``pure``), the breakdown of a score of single pixels has
these as ``interior`` and the others as ``boundary``.

*Gauge.* A scale of albedo is fitted on the training views only, once per scene, by least squares in
linear light over the mask, and is printed in the score. Raw, scalar and per-channel are three
metrics, always shown together. SSIM and FLIP of base colour are per channel, CIEDE2000 is scalar, so that
a colour cast counts, and LMSE fits windows of its own.

*Colour space.* ``base_color`` PSNR is in linear light. Radiance, and all SSIM and FLIP, are compared
as displayed: ``srgb_encode(radiance * exposure)`` with the one exposure of the scene. The breakdown of a
PSNR has the other space: ``srgb`` of base colour, ``linear`` (times the exposure) of radiance.

*Pooling.* PSNR: mean square error per view, mean over views, PSNR of that mean (the mean of PSNRs,
``mean_of_views`` in the breakdown, is higher, by Jensen). All else: value per view, mean over views.
Lights: mean over matched pairs; in the position each light without a partner counts as one that is a whole
scene away (as in the OSPA metric of Schuhmacher, Vo and Vo 2008, order 1, cut off at the diameter), so that
neither few good guesses nor very many pay.

*Noise.* Where the truth is estimated, the breakdown of a PSNR has it ``debiased``: the mean square error
less the truth's own mean variance, as displayed. Infinite: no error that the noise does not explain.
Where the display clips most of a picture to black, up to a quarter of the noise stays in, on the safe
side. An exact truth has no such number.

*Faults.* A metric whose layer is missing in a view, of wrong size, not finite or unreadable has
failed, with the reason; a view is never left out and nothing is put in its place. A layer that no
view has is "not provided". A file that cannot be read may hold any layer, so it fails all images.

``graycard-0`` was the same without breakdowns, CIEDE2000 and LMSE: a score of it has the value that
``graycard-1`` gives to the metric of that name.
"""

from dataclasses import dataclass

from graycard.eval._protocol import NAME, VERSION
from graycard.eval.metrics._registry import find_metric
from graycard.eval.protocols._base import Protocol, Rules
from graycard.eval.scoring._training import GAUGED


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetProtocol(Protocol):
    """The protocol of whole score sheets; :func:`graycard.eval.registry` lists the metrics."""

    def rules_of(self, metric: str) -> Rules:
        """Return what it does to come to a metric, in words for a table.

        Raises:
            UnknownNameError: There is no such metric.
        """
        found = find_metric(metric)
        return Rules(
            pixels="mask",
            gauge=_fit_of(found.gauge),
            fitted_on="all training views" if found.gauge else "no view",
            space=found.rule.space_name,
            pooling="PSNR of the mean error" if found.record.unit == "dB" else "mean of views",
            channels="together",
            exposure="1 is white" if found.layer == GAUGED else "the one exposure of the scene",
        )


def _fit_of(gauge: str | None) -> str:
    if gauge is None:
        return "none"
    return f"least squares, {'one factor' if gauge.endswith('scalar') else 'per channel'}"


GRAYCARD = SheetProtocol(
    name=NAME,
    version=VERSION,
    summary="raw, one factor and one factor a channel, fitted on training views",
    source="graycard.eval.protocols",
)
"""``graycard-1``."""
