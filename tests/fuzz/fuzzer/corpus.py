# SPDX-License-Identifier: Apache-2.0
"""The sound inputs that are changed: scenes, predictions, runs, exports, decompositions and texts."""

import gzip
import shutil
from collections.abc import Callable, Iterable
from dataclasses import fields
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

from changed_scene import enrich
from fuzzer.texts import CLAIMS, PRIORS, SUITE
from graycard import open_capture, open_truth
from graycard.benchmarks import FitSpec, fit_scene, make_baseline
from graycard.cli import main
from graycard.dataset import manifest_of
from graycard.exchange import export_capture
from graycard.io import silent, write_json, write_manifest
from graycard.methods import BUILT_IN, load_method
from graycard.methods.priors import PriorSpec, parse_priors
from graycard.methods.priors._spec import OWN_WEIGHTS
from graycard.methods.splat import save_surfels
from graycard.methods.trained import read_splat, write_splat
from graycard.records import read_run
from graycard.reports import publish_run
from graycard.reports.history._keep import OWN
from random_gaussians import random_gaussians
from random_surfels import random_surfels
from sparse_points import with_points
from splat_files import inria_columns, raw_splat, write_ply
from valid_runs import write_valid_run

WriteScene = Callable[..., Path]
_QUICK = {"iterations": 4, "surfels": 60, "fill": 0.0, "sky_size": 4, "lamps": 2}
"""Least settings that make each part of the method's decomposition."""
_ORACLE = ("darkgs", "sunfaded", "removal", "removal-per-view", "removal-one-reference", "grouping")
_CLASSICAL = ("gsid", "goris")
_TRACKS = {"darkgs": "dark", "sunfaded": "dark", "sunfaded-oracle": "dark", "2dgs-oracle": "dark"}
_OF_TARGETS = ("removal", "removal-per-view", "removal-one-reference", "grouping", "do-nothing", "goris")


def decomposition(method: str) -> str:
    """Return the name in the corpus of what a method saves."""
    return f"saved/{method}/{method}"


def build(root: Path, names: Iterable[str], write_scene: WriteScene) -> None:
    """Make what some kinds need, below ``root/corpus``.

    Args:
        root: A folder.
        names: What is needed, as in :attr:`fuzzer.kind.Kind.inputs`.
        write_scene: As the fixture ``write_tiny``.
    """
    corpus, needed = root / "corpus", set(names)
    for track in ("dark", "tabletop", "multilight"):
        scene = enrich(write_scene(corpus / "dataset", track=track))
        manifest = manifest_of(open_capture(scene / "capture"))
        with_points(scene)
        write_manifest(scene / "capture", manifest)
    _exports(corpus)
    _predictions(corpus)
    _outputs(corpus)
    if needed & {"run", "published", "baseline.json"}:
        _runs(corpus, write_scene)
    for method in BUILT_IN:
        if decomposition(method) in needed or (method == "2dgs" and "checkpoint.safetensors" in needed):
            _save(corpus, method)
    for name, text in {
        "suite.toml": SUITE,
        "claims.toml": CLAIMS,
        "priors.toml": PRIORS,
        "priors.txt": "oracle:3",
    }.items():
        (corpus / name).write_text(text)
    shutil.copy(OWN_WEIGHTS, corpus / "own.safetensors")
    save_surfels(corpus / "surfels.safetensors", random_surfels(8))
    _splats(corpus / "splats")


def _exports(corpus: Path) -> None:
    scene = corpus / "dataset" / "tabletop" / "tiny-0000"
    for form in ("nerfstudio", "colmap", "colmap-binary", "blender", "tensoir"):
        export_capture(scene, form, corpus / form)
    shutil.copytree(corpus / "nerfstudio", corpus / "jpeg")
    index = corpus / "jpeg" / "transforms.json"
    index.write_text(index.read_text().replace('.png"', '.jpg"'))
    for path in (corpus / "jpeg").rglob("*.png"):
        Image.open(path).convert("RGB" if "images" in path.parts else "L").save(path.with_suffix(".jpg"))
        path.unlink()


def _splats(folder: Path) -> None:
    """Files of trained splats: text, binary, and without a header."""
    folder.mkdir()
    raw = raw_splat(random_gaussians(12, 0, opacities=(0.1, 0.9)), 1)
    write_ply(folder / "text.ply", inria_columns(raw), "ascii")
    write_ply(folder / "binary.ply", inria_columns(raw), "binary_big_endian")
    discs = read_splat(write_ply(folder / "discs.ply", inria_columns(raw)), "2dgs")
    write_splat(folder / "records.splat", discs, "splat")


def _predictions(corpus: Path) -> None:
    scene = corpus / "dataset" / "multilight" / "tiny-0000"
    for method in ("gray", "truth"):
        fit_scene(FitSpec(method, {}, 0, scene), corpus / "predictions" / method, silent)


def _outputs(corpus: Path) -> None:
    """Write true layers in each kind of file that is adopted, and photographs of held-out views."""
    scene, folder = corpus / "dataset" / "multilight" / "tiny-0000", corpus / "outputs"
    truth, header = open_truth(scene / "truth"), {"type": OpenEXR.scanlineimage}
    folder.mkdir()
    for view in (v for v in truth.views if v.split == "test"):
        layers = truth.layers(view)
        np.save(folder / f"depth_{view.name}.npy", np.nan_to_num(layers["depth"], posinf=9))
        np.savez(folder / f"rough_{view.name}.npz", roughness=layers["roughness"])
        Image.fromarray((layers["base_color"] * 255).astype(np.uint8)).save(
            folder / f"albedo_{view.name}.png"
        )
        Image.fromarray(layers["roughness"]).save(folder / f"metal_{view.name}.tiff")
        planes = {c: np.array(layers["normal"][..., i], order="C") for i, c in enumerate("XYZ")}
        OpenEXR.File(header, planes).write(str(folder / f"normal_{view.name}.exr"))
        with gzip.open(folder / f"light_{view.name}.npy.gz", "wb") as file:
            np.save(file, layers["radiance"])
    away = corpus / "held-out"
    shutil.copytree(corpus / "nerfstudio", away)
    first = next((away / "images").iterdir())
    for view in (v for v in truth.views if v.split == "test"):
        shutil.copy(first, away / "images" / f"{view.name}.png")


def _runs(corpus: Path, write_scene: WriteScene) -> None:
    run = write_valid_run(corpus / "run", write_scene)
    claims = corpus / "of-run.toml"
    claims.write_text(CLAIMS)
    assert main(["claims", str(run), "--claims", str(claims)]) == 0, "the claims of the corpus are judged"
    write_json(corpus / "baseline.json", make_baseline(read_run(run)))
    (corpus / "published").mkdir()
    for name in ("history.json", "history.toml"):
        shutil.copy(OWN / name, corpus / "published")
    publish_run(run, corpus / "published" / "tiny", 100)


def _save(corpus: Path, method: str) -> None:
    known = {field.name for field in fields(load_method(method).settings_type)}
    chosen = {
        name: value for name, value in _QUICK.items() if name in known and (method, name) != ("gsir", "lamps")
    }
    kept = corpus / "kept" / "checkpoint.safetensors"  # a fit may write to its folder, so no data lie there
    if method == "2dgs":
        chosen["checkpoint"] = str(kept)
    priors = PriorSpec()
    if method in _ORACLE:
        priors = parse_priors("oracle:0")
    elif method in _CLASSICAL:
        priors = parse_priors("classical")
    track = "tabletop" if method in _OF_TARGETS else _TRACKS.get(method, "multilight")
    spec = FitSpec(method, chosen, 0, corpus / "dataset" / track / "tiny-0000", priors=priors)
    fit_scene(spec, corpus / "fitted" / method, silent, corpus / decomposition(method))
    if method == "2dgs":
        kept.rename(corpus / kept.name)
