# SPDX-License-Identifier: Apache-2.0
"""Kinds of what methods keep: decompositions, checkpoints and weights."""

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from safetensors import safe_open

from fuzzer.corpus import decomposition
from fuzzer.kind import Kind, each
from fuzzer.tensors import attack_decomposition, attack_tensors, seal_decomposition
from graycard.methods import BUILT_IN
from graycard.methods.splat import Checkpoint, check_saved, load_state

_SCENE = "dataset/tabletop/tiny-0000"


def _load(method: str) -> Callable[[Path, Path], None]:
    def read(folder: Path, out: Path) -> None:
        from graycard import open_capture
        from graycard.methods import load_method

        found = load_method(method).load(folder / method)
        camera = open_capture(folder / "tiny-0000" / "capture", check=False).views[0].camera
        found.render(camera, sorted(found.provides))
        found.lights()
        found.save(out / "again")

    return read


def _checkpoint(folder: Path, _: Path) -> None:
    path = folder / "checkpoint.safetensors"
    each(lambda: check_saved(path, ""), lambda: load_state(_open_checkpoint(path)))


def _open_checkpoint(path: Path) -> Checkpoint:
    """Return a checkpoint whose identity is the one that stands in the file, as far as it can be read."""
    identity = ""
    with suppress(Exception), safe_open(path, framework="np") as file:  # reading it is to say what is wrong
        identity = json.loads((file.metadata() or {}).get("fit", "{}")).get("identity", "")
    return Checkpoint(path, 1, identity if isinstance(identity, str) else "")


def _surfels(folder: Path, _: Path) -> None:
    from graycard.methods.splat import load_surfels

    load_surfels(folder / "surfels.safetensors")


def _weights(folder: Path, _: Path) -> None:
    from graycard import open_capture
    from graycard.methods import Ask
    from graycard.methods.priors import make_priors, parse_priors

    capture = open_capture(folder / "tiny-0000" / "capture", check=False)
    spec = parse_priors(f"pretrained:{folder / 'own.safetensors'}")
    view = capture.train[0]
    priors = make_priors(spec, [Ask("normal", ("radiance",))], capture, {})
    priors.normal(capture.photograph(view), view)


METHODS = (
    *(
        Kind(
            f"decomposition: {method}",
            (decomposition(method), _SCENE),
            lambda rng, folder, m=method: attack_decomposition(rng, folder / m),
            _load(method),
            lambda folder, m=method: seal_decomposition(folder / m),
        )
        for method in BUILT_IN
    ),
    Kind(
        "checkpoint",
        ("checkpoint.safetensors",),
        lambda rng, folder: attack_tensors(rng, folder / "checkpoint.safetensors"),
        _checkpoint,
        weight=8,
    ),
    Kind(
        "surfels",
        ("surfels.safetensors",),
        lambda rng, folder: attack_tensors(rng, folder / "surfels.safetensors"),
        _surfels,
        weight=8,
    ),
    Kind(
        "own weights",
        ("own.safetensors", _SCENE),
        lambda rng, folder: attack_tensors(rng, folder / "own.safetensors"),
        _weights,
    ),
)
