# SPDX-License-Identifier: Apache-2.0
"""One scene on disk: ``capture/`` is what a method may see, ``truth/`` is what it is judged by.

DATASET/<track>/<scene>/capture/  manifest.json capture.json points.ply photographs/ masks/<mask>/<view>.exr
DATASET/<track>/<scene>/truth/    manifest.json truth.json lights.json [environment.exr] views/<view>.exr
                                  relighting/<edit>/{lights.json [environment.exr] views/<view>.exr}
                                  [composition/{composition.json views/<view>.exr}]
DATASET/<track>/<scene>/held_out/ manifest.json [sensor.json] photographs/<view>.exr
                                  of an imported capture, without truth
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from graycard._capture import Capture, file_of
from graycard._errors import DatasetError, UnknownNameError
from graycard._held_out import HELD_OUT as HELD_OUT
from graycard._held_out import PHOTOGRAPHS, SENSOR
from graycard._held_out import HeldOut as HeldOut
from graycard._sensor import Sensor
from graycard._truth import Truth
from graycard.io import (
    MANIFEST,
    Manifest,
    check_distinct,
    check_files,
    from_builtins,
    read_json,
    read_manifest,
    sha256,
    write_json,
)

TRACKS = ("dark", "tabletop", "multilight")

SECRET_SEEDS = range(2**63, 2**64)
"""Seeds of secret scenes, which follow from the salt of a suite; nothing outside of ``truth/`` shows one."""

IMPORTER = "graycard.import"
"""Generator, in the manifest, of a capture that holds a user's own photographs: it has no truth."""


def open_capture(folder: Path, *, check: bool = True) -> Capture:
    """Return the capture in ``folder`` (``.../<scene>/capture``).

    Args:
        folder: The capture folder.
        check: Compare every file with its SHA-256 first.

    Raises:
        DatasetError: It is missing, half-written, damaged, or of a newer format.
    """
    return _open(Capture, Path(folder), "capture", check)


def open_truth(folder: Path, *, check: bool = True) -> Truth:
    """Return the truth in ``folder`` (``.../<scene>/truth``).

    Args:
        folder: The truth folder.
        check: Compare every file with its SHA-256 first.

    Raises:
        DatasetError: It is missing (an imported capture has none), half-written, damaged, or of a newer
            format.
    """
    _refuse_imported(Path(folder))
    return _open(Truth, Path(folder), "truth", check)


def open_held_out(scene: Path, *, check: bool = True) -> HeldOut:
    """Return the photographs of held-out views beside an imported capture.

    Args:
        scene: ``DATASET/<track>/<scene>``.
        check: Compare every file with its SHA-256 first.

    Raises:
        DatasetError: The capture is missing, no photograph was held out, or one is damaged.
    """
    capture, folder = open_capture(Path(scene) / "capture", check=check), Path(scene) / HELD_OUT
    if not (folder / MANIFEST).is_file():
        what = f"{len(capture.test)} held-out views without one" if capture.test else "no held-out view"
        raise DatasetError(
            f"expected truth or photographs of held-out views at {folder}, got {what}. Import the capture "
            "again, with another --scene, --hold-out 8, and the photographs of all views there"
        )
    manifest = read_manifest(folder, "graycard-held-out")
    if (manifest.track, manifest.scene) != (capture.track, capture.scene):
        raise DatasetError(
            f"expected {folder} to be of {capture.track}/{capture.scene}, got "
            f"{manifest.track}/{manifest.scene}. Import the capture again"
        )
    if check:
        check_files(folder, manifest)
    views = tuple(v for v in capture.test if f"{PHOTOGRAPHS}/{v.name}.exr" in manifest.files)
    return HeldOut(capture, views, folder, sha256(folder / MANIFEST), _sensor_of(folder, manifest))


def _sensor_of(folder: Path, manifest: Manifest) -> Sensor | None:
    if SENSOR not in manifest.files:
        return None
    path = folder / SENSOR
    return from_builtins(Sensor, read_json(path, DatasetError), DatasetError, str(path))


def write_index(folder: Path, content: Capture | Truth) -> None:
    """Write ``capture.json`` or ``truth.json``; the manifest is sealed after it."""
    name = "capture" if isinstance(content, Capture) else "truth"
    write_json(Path(folder) / f"{name}.json", content)


def capture_folders(dataset: Path) -> list[Path]:
    """Return the folders ``<track>/<scene>`` with a whole capture and a whole truth or none, sorted.

    Of a folder that is itself a scene: that one, as an absolute path.
    """
    folders = [p for track in TRACKS for p in sorted((Path(dataset) / track).glob("[!.]*"))]
    folders = [Path(dataset).resolve()] if is_scene(dataset) else folders
    parts = [(p, p / "capture" / MANIFEST, p / "truth") for p in folders]
    return [p for p, capture, truth in parts if capture.is_file() and _is_whole_or_absent(truth)]


def is_scene(folder: Path) -> bool:
    """Return whether a folder is that of a scene, ``DATASET/<track>/<scene>``, and none of scenes."""
    return (Path(folder) / "capture" / MANIFEST).is_file()


def is_imported(scene: Path) -> bool:
    """Tell whether a scene is a user's own photographs, which have no truth beside them."""
    return not has_truth(scene) and is_in_display_white(scene)


def is_in_display_white(scene: Path) -> bool:
    """Tell whether light of a scene is in units of display white, as that of imported photographs is.

    It is so beside an imported truth, too. Light of a rendered scene is in W/m²/sr.
    """
    capture = Path(scene) / "capture"
    if not (capture / MANIFEST).is_file():
        return False
    return read_manifest(capture, "graycard-capture").generator.get("name") == IMPORTER


def has_truth(scene: Path) -> bool:
    """Tell whether a scene has a truth that is whole; an imported capture has none."""
    return (Path(scene) / "truth" / MANIFEST).is_file()


def check_scene(folder: Path) -> None:
    """Refuse a folder one level above or below a scene, and say which one is meant.

    Args:
        folder: ``DATASET/<track>/<scene>``, if all is well; what is missing there is met when it is opened.

    Raises:
        DatasetError: It is a part of a scene, or a folder of scenes.
        UnknownNameError: It is not there, and other scenes are beside it.
    """
    scene = Path(folder).resolve()
    if (scene / "capture").is_dir():
        return
    if not scene.exists():
        beside = [path.name for path in scene.parent.glob("[!.]*") if is_scene(path)]
        if beside:
            raise UnknownNameError(f"scene in {folder.parent}", scene.name, beside)
    meant = None
    if len(scene.parents) < 2 or (scene.parent / "capture" / MANIFEST).is_file():
        meant = scene.parent if scene.name in ("capture", "truth") else "DATASET/<track>/<scene>"
    elif scenes := [
        *capture_folders(scene),
        *(p for p in capture_folders(scene.parent) if scene in p.parents),
    ]:
        meant = f"one of its scenes, as {scenes[0]}"
    if meant is not None:
        raise DatasetError(
            f"expected the folder of a scene, DATASET/<track>/<scene>, got {folder}. Give {meant}"
        )


def manifest_of(content: Capture | Truth) -> Manifest:
    """Return the manifest of an opened capture or truth."""
    kind = "graycard-capture" if isinstance(content, Capture) else "graycard-truth"
    return read_manifest(file_of(content.root, ""), kind)


def _open(cls: type[Any], folder: Path, name: str, check: bool) -> Any:
    manifest = read_manifest(folder, f"graycard-{name}")
    if check:
        check_files(folder, manifest)
    path = folder / f"{name}.json"
    found = from_builtins(cls, read_json(path, DatasetError), DatasetError, str(path))
    if (found.track, found.scene) != (manifest.track, manifest.scene):
        raise DatasetError(
            f"expected {path} to be of {manifest.track}/{manifest.scene}, as its manifest says, "
            f"got {found.track}/{found.scene}"
        )
    _check_distinct(found, path)
    wanted = (
        {"train"} if cls is Capture else {"train", "test"}
    )  # photographs of a user may all be for training
    if not wanted <= {view.split for view in found.views}:
        raise DatasetError(
            f"expected {' and '.join(sorted(wanted))} views in {path}, got {len(found.views)} views"
        )
    return replace(found, root=folder)


def _check_distinct(found: Capture | Truth, path: Path) -> None:
    """Refuse views, or edits, whose files are one where names differ in case alone."""
    edits = found.edits if isinstance(found, Truth) else ()
    try:
        check_distinct(view.name for view in found.views)
        check_distinct(edit.name for edit in edits)
    except ValueError as cause:
        raise DatasetError(f"{path}: {cause}. Rename one") from cause


def _is_whole_or_absent(folder: Path) -> bool:
    return not folder.exists() or (folder / MANIFEST).is_file()


def _refuse_imported(folder: Path) -> None:
    """Say that a capture of a user's own photographs has no truth.

    Raises:
        DatasetError: ``folder`` would be the truth beside such a capture.
    """
    if not folder.exists() and is_imported(folder.parent):
        raise DatasetError(
            f"expected the truth of a rendered scene at {folder}, got an imported capture, which has no "
            "truth: methods that need none can be fitted to it, `graycard score PREDICTIONS SCENE` judges "
            "its held-out photographs, and `graycard report SCENE --predictions NAME=PREDICTIONS` shows them"
        )
