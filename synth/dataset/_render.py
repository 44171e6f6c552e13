# SPDX-License-Identifier: Apache-2.0
"""From a spec to a scene folder: rendered once, resumed where it was cut off, mended where it is damaged.

One process makes a scene by :func:`render_scene`. Several share the work so: one calls :func:`begin_scene`,
each renders some of the missing pictures by :func:`render_part`, and :func:`render_scene` does the rest.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from uuid import uuid4

from graycard import DatasetError, OutputError, Progress, RecordError
from graycard.io import (
    await_file,
    file_lock,
    read_json,
    read_manifest,
    remove_leftovers,
    silent,
    writable_folder,
)
from graycard.synth._spec import RenderSettings, SceneSpec, SecretSpec
from graycard.synth.dataset._finish import finish
from graycard.synth.dataset._identity import BANDS, NEEDED, differences, identity
from graycard.synth.dataset._renderings import (
    Content,
    content_of,
    missing,
    renderings,
    write_aside,
    write_missing,
)
from graycard.synth.dataset._store import (
    Place,
    damage,
    discard,
    foreign_content,
    is_made,
    leftovers,
    promote,
    reopen,
    resume,
    stamped,
)
from graycard.synth.families import family_of, scene_name
from graycard.synth.renderer._variant import can_render, use_renderer


def render_scene(
    spec: SceneSpec,
    settings: RenderSettings,
    dataset: Path,
    progress: Progress = silent,
    threads: int | None = None,
    *,
    on_cost: Callable[[float], None] = lambda cpu_s: None,
) -> Path:
    """Render a scene into ``dataset/<track>/<scene>``, or find it there whole and leave it.

    The same spec, settings and renderer variant give the same bits, with any number of threads, and
    whether or not the work was cut off in between. What is missing or damaged is made anew.

    Args:
        spec: Which scene.
        settings: How it is photographed.
        dataset: The dataset folder.
        progress: Told about each view.
        threads: Number of threads; None for one a core.
        on_cost: Told the CPU time over all cores, seconds, of a scene that was rendered in one go.

    Returns:
        The scene folder.

    Raises:
        UnknownNameError: There is no such family.
        RecordError: A knob is unknown or out of its range.
        DatasetError: The folder holds a scene of another spec, or something else.
        OutputError: The dataset folder cannot be written to, or the disk is full.
    """
    place = Place(Path(dataset), spec.track, scene_name(spec))
    if find_scene(spec, settings, dataset) is None:
        writable_folder(place.final.parent)
        with file_lock(place.lock, lambda who: progress(0.0, f"{who} is at work on it")):
            if find_scene(spec, settings, dataset) is None:
                begun = time.process_time()
                if _make(place, spec, settings, progress, threads):
                    on_cost(time.process_time() - begun)
    progress(1.0, "it is there")
    return place.final


def find_scene(spec: SceneSpec, settings: RenderSettings, dataset: Path) -> Path | None:
    """Return the folder of a scene that is there, whole and of this spec; None if it is to be rendered.

    Raises:
        UnknownNameError: There is no such family.
        RecordError: A knob is unknown or out of its range.
        DatasetError: The folder holds a scene of another spec, or something else.
    """
    place = Place(Path(dataset), spec.track, scene_name(spec))
    found = _found_of_this_spec(place, spec, settings)
    return None if found is None or damage(place) else place.final


def clear_leftovers(dataset: Path) -> None:
    """Remove from a dataset what renderings that were killed have left and no other goes on from.

    Scenes that are half-made stay: the next rendering goes on with them. So does what cannot be removed.
    """
    for place in leftovers(Path(dataset)):
        with suppress(OSError, OutputError), file_lock(place.lock, lambda who: None):
            if is_made(place):  # another process may have begun to mend it meanwhile
                discard(place.work)
    remove_leftovers(Path(dataset))


def begin_scene(
    spec: SceneSpec, settings: RenderSettings, dataset: Path, threads: int | None = None
) -> tuple[int, ...]:
    """Get a scene ready to be rendered in parts.

    Args:
        spec: As of :func:`render_scene`, as all others.
        settings: As there.
        dataset: As there.
        threads: As there.

    Returns:
        The numbers of the pictures that are missing; none where the scene is there and whole.

    Raises:
        GraycardError: As of :func:`render_scene`.
    """
    place = Place(Path(dataset), spec.track, scene_name(spec))
    if find_scene(spec, settings, dataset) is not None:
        return ()
    writable_folder(place.final.parent)
    with file_lock(place.lock, lambda who: None):
        if find_scene(spec, settings, dataset) is not None:
            return ()
        stamp = _open(place, spec, settings, threads)
    wanted = renderings(_content(spec, settings), spec.seed, settings, stamp["variant"])
    return tuple(number for number, _ in missing(wanted, place.partial / "truth"))


def render_part(
    spec: SceneSpec,
    settings: RenderSettings,
    dataset: Path,
    numbers: Sequence[int],
    threads: int | None = None,
) -> None:
    """Render some pictures of a scene that was begun, while other processes may render others.

    Pictures that are there are kept. The bits are those of :func:`render_scene`.

    Args:
        spec: As of :func:`begin_scene`.
        settings: As there.
        dataset: As there.
        numbers: Some of those that :func:`begin_scene` returned.
        threads: As there.

    Raises:
        DatasetError: The scene was not begun, or with another spec or renderer.
        OutputError: The dataset folder cannot be written to, or the disk is full.
    """
    place = Place(Path(dataset), spec.track, scene_name(spec))
    if find_scene(spec, settings, dataset) is not None:
        return
    await_file(place.stamp)
    stamp = stamped(place)
    variant = str((stamp or {}).get("variant", ""))
    if stamp is None or differences(stamp, {**identity(spec, settings), "variant": variant}, spec, settings):
        raise DatasetError(f"expected {place.work} to hold a scene of this spec that was begun, got another")
    if not can_render(variant):
        raise DatasetError(
            f"expected a machine that renders with {variant!r}, as the scene was begun with it. Install LLVM "
            "there (`graycard doctor` says how)"
        )
    wanted = renderings(_content(spec, settings), spec.seed, settings, variant)
    mine = [wanted[number] for number in numbers]
    todo = missing(mine, place.partial / "truth")
    if todo:
        use_renderer(threads, variant)
    for _, rendering in todo:  # another process may end the scene meanwhile, or begin one of another spec
        truth, aside = place.partial / "truth", place.aside(uuid4().hex)
        write_aside(rendering, truth, aside, lambda: stamped(place) == stamp)


def _make(
    place: Place, spec: SceneSpec, settings: RenderSettings, progress: Progress, threads: int | None
) -> bool:
    """Render what is missing, derive the rest, seal; return true where all pictures were missing."""
    stamp = _open(place, spec, settings, threads)
    content = _content(spec, settings)
    wanted = renderings(content, spec.seed, settings, stamp["variant"])
    truth = place.partial / "truth"
    todo = missing(wanted, truth)
    if todo:
        use_renderer(threads, stamp["variant"])
    for number, rendering in todo:
        progress(number / len(wanted), f"picture {number + 1} of {len(wanted)}, {rendering.doing}")
        write_missing(rendering, truth)
    finish(place, content, stamp)
    promote(place)
    return len(todo) == len(wanted)


def _open(place: Place, spec: SceneSpec, settings: RenderSettings, threads: int | None) -> dict[str, Any]:
    """Make the partial folder ready, with what is whole in it or in a damaged scene, and return its stamp."""
    made_from = identity(spec, settings)
    found = _found_of_this_spec(place, spec, settings)
    if found is not None:
        reopen(place, {**made_from, "variant": found["variant"]}, damage(place))
    stamp = {**made_from, "variant": _variant_for(place, threads)}
    begun = stamped(place)
    resume(place, stamp, same=begun is not None and not differences(begun, stamp, spec, settings))
    return stamp


def _content(spec: SceneSpec, settings: RenderSettings) -> Content:
    """Build the scene, with all changes that its settings ask for."""
    return content_of(family_of(spec).build(spec.seed, settings), spec.seed, settings)


def _variant_for(place: Place, threads: int | None) -> str:
    """Return the variant that existing views were rendered with, if it runs here; else the fastest."""
    variant = (stamped(place) or {}).get("variant")
    if isinstance(variant, str) and can_render(variant):
        return variant
    return use_renderer(threads).variant


def _found_identity(place: Place) -> dict[str, Any] | None:
    """Return what the final folder's truth says it was made from; None where it cannot be told."""
    path = place.final / "truth" / "manifest.json"
    try:
        read_json(path)
    except RecordError:
        return None
    manifest = read_manifest(path.parent, "graycard-truth")
    return {
        "generator": manifest.generator.get("generator"),
        "track": manifest.track,
        "family": manifest.settings.get("family"),
        "seed": manifest.seeds.get("scene"),
        "knobs": manifest.settings.get("knobs"),
        "render": manifest.settings.get("render"),
        NEEDED: manifest.settings.get(NEEDED),
        BANDS: manifest.settings.get(BANDS),
        "variant": manifest.generator.get("variant"),
    }


def _found_of_this_spec(place: Place, spec: SceneSpec, settings: RenderSettings) -> dict[str, Any] | None:
    """Return what the final folder was made from, if it is there.

    Raises:
        DatasetError: It is of another spec, or holds something else.
    """
    _check_foreign(place)
    found = _found_identity(place)
    if found is not None and (differ := differences(found, identity(spec, settings), spec, settings)):
        if isinstance(spec, SecretSpec):  # the lines would tell seeds
            differ = [f"{line.partition(':')[0]}: another" for line in differ]
        raise DatasetError(
            f"expected {place.final} to be free or to hold this very scene, got one of another spec "
            f"({'; '.join(differ)}). Choose another output folder, or delete this one"
        )
    return found


def _check_foreign(place: Place) -> None:
    names = foreign_content(place)
    if names:
        raise DatasetError(
            f"expected {place.final} to be free or to hold a scene, got {', '.join(names[:3])} in it. "
            "Choose another output folder, or move this one away"
        )
