# SPDX-License-Identifier: Apache-2.0
"""All checks of all scenes of a dataset."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard import TRACKS, DatasetError, Progress
from graycard.io import silent
from graycard.synth._scene import LambertGGX
from graycard.synth._spec import RenderSettings
from graycard.synth.renderer._variant import use_renderer
from graycard.synth.verify._captures import check_capture, check_exposure, check_index
from graycard.synth.verify._check import At, Check
from graycard.synth.verify._counterfactual import check_counterfactual
from graycard.synth.verify._files import FILES, check_files, is_imported
from graycard.synth.verify._geometry import check_between, check_geometry
from graycard.synth.verify._irradiance import check_background, check_irradiance
from graycard.synth.verify._materials import check_materials, check_objects
from graycard.synth.verify._relit import check_edits, check_relit
from graycard.synth.verify._specified import SPECIFIED, check_specified
from graycard.synth.verify._statistics import FALSE_ALARM
from graycard.synth.verify._subject import Rebuilt, Subject, TruePicture, open_subject, rebuild
from graycard.synth.verify._summaries import Summary
from graycard.synth.verify._transport import check_halves, check_parts
from graycard.synth.verify._values import check_values

RENDERED = "rendered again"
"""Name under which it is said that nothing was rendered."""


@dataclass(frozen=True, slots=True)
class VerifyVerdict:
    """Findings of the verification of a dataset."""

    checks: tuple[Check, ...]
    scenes: int
    """Scene folders that were looked at."""
    false_alarm: float = FALSE_ALARM
    """Rate: how often a faultless scene fails any of its statistical checks, at most."""

    def count(self, status: str) -> int:
        """Return how many checks there are of a status."""
        return sum(check.status == status for check in self.checks)


def verify_dataset(
    dataset: Path, views: int = 3, render: bool = True, progress: Progress = silent
) -> VerifyVerdict:
    """Check every scene of a dataset: its files, its geometry, its light, and a second rendering of it.

    A scene that is damaged, cut off or malformed fails the check ``files`` and the others go on.

    Args:
        dataset: The dataset folder.
        views: How many views of each scene are rendered again.
        render: Whether any is.
        progress: Told about each scene.

    Raises:
        DatasetError: There is no scene in the folder.
        RenderError: Mitsuba does not run here.
        ValueError: ``views`` is below 1.
    """
    if views < 1:
        raise ValueError(f"expected 1 or more views, got {views}")
    folders = _scene_folders(Path(dataset))
    if not folders:
        raise DatasetError(
            f"expected scenes DATASET/<track>/<scene> in {dataset}, got none. Run `graycard render`"
        )
    checks: list[Check] = []
    for number, folder in enumerate(folders):
        progress(number / len(folders), f"{folder.parent.name}/{folder.name}")
        checks += verify_scene(folder, views if render else 0)
    return VerifyVerdict(tuple(checks), len(folders))


def _scene_folders(dataset: Path) -> list[Path]:
    """All folders that are meant to be scenes, whole or not."""
    return [p for track in TRACKS for p in sorted((dataset / track).glob("[!.]*")) if p.is_dir()]


def verify_scene(folder: Path, views: int) -> list[Check]:
    """All checks of one scene; ``views`` of it are rendered again."""
    at = At(f"{folder.parent.name}/{folder.name}")
    if is_imported(folder):
        return [at.skip(FILES, "an imported capture has no truth that could be verified")]
    checks = list(check_files(folder, at))
    if any(check.status == "failed" for check in checks):
        return checks
    with np.errstate(all="ignore"):  # what a broken value makes of a figure is judged, not warned about
        return checks + list(_checks_of(open_subject(folder), views))


def _checks_of(subject: Subject, views: int) -> Iterator[Check]:
    yield from check_index(subject)
    rebuilt = rebuild(subject.manifest)
    if isinstance(rebuilt, Rebuilt):
        yield from check_specified(subject, rebuilt)
        yield from check_edits(subject, rebuilt)
    else:
        yield from (subject.at.skip(name, rebuilt) for name in SPECIFIED)
    sound: list[int] = []
    yield from _check_views(subject, rebuilt, sound)
    yield from _check_rendering(subject, rebuilt, sound, views)


def _check_views(subject: Subject, rebuilt: Rebuilt | str, sound: list[int]) -> Iterator[Check]:
    """Yield checks of each view and of each with the one before.

    The numbers of ``sound`` ones are appended.
    """
    training, before, summary = [], None, _summary(subject, rebuilt)
    for picture in subject.pictures():
        values = list(check_values(subject, picture))
        yield from values
        if picture.view.split == "train" and picture.has("radiance"):
            training.append(picture.layers["radiance"].ravel())
        if any(check.status == "failed" for check in values if check.name != "values in float32"):
            yield picture.at.skip("position on the ray", "its layers are not whole, so no law is applied")
            continue
        sound.append(picture.number)
        yield from _check_picture(subject, rebuilt, picture)
        if isinstance(rebuilt, Rebuilt):
            yield from check_relit(subject, rebuilt, picture)
        summary.add(picture)
        if before is not None:
            at = At(subject.at.scene, f"{before.view.name} in {picture.view.name}")
            yield from check_between(before, picture, at)
        before = picture
    yield from check_exposure(subject, training)
    yield from summary.checks()


def _summary(subject: Subject, rebuilt: Rebuilt | str) -> Summary:
    settings = rebuilt.settings if isinstance(rebuilt, Rebuilt) else RenderSettings()
    return Summary(subject, settings.capture)


def _check_picture(subject: Subject, rebuilt: Rebuilt | str, picture: TruePicture) -> Iterator[Check]:
    yield from check_geometry(picture)
    yield from check_objects(subject, picture)
    yield from check_materials(picture)
    yield from check_capture(subject, picture)
    yield from check_halves(picture, len(subject.truth.views))
    yield from check_counterfactual(subject, picture)
    yield from check_parts(subject, picture, _lambertian(rebuilt))
    yield from check_irradiance(subject, picture)
    yield from check_background(subject, picture)


def _lambertian(rebuilt: Rebuilt | str) -> frozenset[int]:
    """Objects of the material whose lobes are added: its diffuse one is Lambertian, others' need not be."""
    if isinstance(rebuilt, str):
        return frozenset()
    things = enumerate(rebuilt.scene.things, start=1)
    return frozenset(number for number, thing in things if isinstance(thing.material, LambertGGX))


def _check_rendering(
    subject: Subject, rebuilt: Rebuilt | str, sound: list[int], views: int
) -> Iterator[Check]:
    if not views:
        yield subject.at.skip(RENDERED, "only the files were asked for")
        return
    if isinstance(rebuilt, str):
        yield subject.at.skip(RENDERED, rebuilt)
        return
    if not sound or not _is_alike(subject, rebuilt):
        yield subject.at.skip(RENDERED, "the files hold other views, sizes or lights than the spec")
        return
    use_renderer()
    from graycard.synth.verify._rendered import check_rendered  # Mitsuba: not before its variant is chosen

    chosen = _chosen(sound, [n for n in sound if subject.is_split(subject.truth.views[n])], views)
    yield from check_rendered(subject, rebuilt, [subject.picture(number) for number in chosen])


def _chosen(sound: Sequence[int], split: Sequence[int], views: int) -> list[int]:
    """Return so many of the sound views, evenly; the middle one is of those whose light is told apart."""
    places = np.unique(np.linspace(0, len(sound) - 1, min(views, len(sound))).round().astype(int))
    chosen = [sound[place] for place in places]
    if split and not {*chosen} & {*split}:
        middle = len(chosen) // 2
        chosen[middle] = min(split, key=lambda number: abs(number - chosen[middle]))
    return sorted(chosen)


def _is_alike(subject: Subject, rebuilt: Rebuilt) -> bool:
    """Return whether pictures of both can be laid side by side."""
    mine, built = subject.truth.views, rebuilt.scene.views
    sizes = [[(v.camera.width, v.camera.height) for v in views] for views in (mine, built)]
    names = [[light.name for light in lights] for lights in (subject.lights, rebuilt.scene.lights)]
    return sizes[0] == sizes[1] and sorted(names[0]) == sorted(names[1])
