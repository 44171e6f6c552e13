# SPDX-License-Identifier: Apache-2.0
"""The scene that the object of a composition comes from, fitted by the same method."""

from collections.abc import Callable
from pathlib import Path

from graycard import Capture, Composition, DatasetError, open_capture, open_truth
from graycard.methods import Decomposition, Guest
from graycard.synth import donor_scene, scene_name

Fit = Callable[[Capture], Decomposition]
_ADVICE = "Leave out --donor, or `composes` in the suite"


def check_donor(scene: Path, donor: Path) -> None:
    """Refuse a donor that is not where the object comes from which the truth of a scene shows put in.

    Args:
        scene: ``DATASET/<track>/<scene>``.
        donor: The same of the donor.

    Raises:
        DatasetError: The scene has no composition, the donor is missing or another one, or its truth does not
            say which pixels show which object.
    """
    composition = open_truth(scene / "truth", check=False).composition()
    if composition is None:
        raise DatasetError(
            f"expected the truth of {scene} to show an object of another scene put in, got none. {_ADVICE}"
        )
    wanted = composition.donor.track, scene_name(donor_scene(composition.donor))
    capture = open_capture(donor / "capture", check=False)
    if (capture.track, capture.scene) != wanted:
        raise DatasetError(
            f"expected {'/'.join(wanted)}, whose object is put into {scene}, got {capture.track}/"
            f"{capture.scene} at {donor}. {_ADVICE}"
        )
    truth = open_truth(donor / "truth", check=False)
    if any("object_id" not in truth.layers(truth.view(view.name)) for view in capture.train):
        raise DatasetError(
            f"expected layer object_id in the truth of {donor}, got none: it says which object is meant. "
            "Render it anew"
        )


def guest_of(donor: Path, capture: Capture, composition: Composition, fit: Fit) -> Guest | None:
    """Return the object as a method has fitted it.

    Args:
        donor: ``DATASET/<track>/<scene>`` that it comes from.
        capture: The copy of its capture that is fitted.
        composition: Which object.
        fit: The fit.

    Returns:
        None where no training view sees the object: nothing is fitted then.
    """
    truth, wanted = open_truth(donor / "truth"), composition.donor.object_id
    masks = {v.name: truth.layers(truth.view(v.name))["object_id"] == wanted for v in capture.train}
    if not any(mask.any() for mask in masks.values()):
        return None
    return Guest(fit(capture), {view.name: view.camera for view in capture.train}, masks)
