# SPDX-License-Identifier: Apache-2.0
"""Kinds of what scenes are made of: layers, points, pictures, captures, truth, predictions and exports."""

from collections.abc import Callable
from pathlib import Path
from random import Random

from fuzzer.kind import Attack, Kind, cli, each
from fuzzer.pictures import attack_exr, attack_picture, attack_pixels
from fuzzer.plain import attack_bytes, attack_lines
from fuzzer.structure import attack_json
from fuzzer.tree import attack_file, attack_tree, files_below, seal

SCENE = "dataset/multilight/tiny-0000"
_IN = "tiny-0000"


def one_of(pattern: str, *attacks: Attack) -> Attack:
    """Return an attack on one of the files below the input that match a pattern."""

    def attack(rng: Random, folder: Path) -> str:
        path = rng.choice(sorted(p for p in folder.glob(pattern) if p.is_file()))
        return rng.choice(attacks)(rng, path)

    return attack


def any_file(below: str = "") -> Attack:
    """Return an attack on any file below a folder of the input, or on the folders themselves."""

    def attack(rng: Random, folder: Path) -> str:
        if rng.random() < 0.5:
            return attack_tree(rng, folder / below)
        return attack_file(rng, rng.choice(files_below(folder / below)))

    return attack


def sealed(*parts: str) -> Callable[[Path], None]:
    """Return a function that makes the manifests of parts of a scene right again."""

    def seal_all(folder: Path) -> None:
        for part in parts:
            seal(folder / part)

    return seal_all


def _read_layers(folder: Path, _: Path) -> None:
    from graycard.io import read_known_layers, read_layers, read_rgb, unknown_channels

    layers, plain = folder / "test_001.exr", folder / "train_000.exr"
    each(
        lambda: read_layers(layers),
        lambda: read_known_layers(layers),
        lambda: unknown_channels(layers),
        lambda: read_rgb(plain),
    )


def _read_points(folder: Path, _: Path) -> None:
    from graycard.points import read_points

    for path in folder.iterdir():
        each(lambda p=path: read_points(p))


def _read_splat(folder: Path, _: Path) -> None:
    from graycard.methods.trained import read_splat

    for path in folder.glob("*/*"):
        each(lambda p=path: read_splat(p))


def _import(source: str, mask: str = "") -> Callable[[Path, Path], None]:
    def read(folder: Path, out: Path) -> None:
        cli("import", folder / source, "--track", "tabletop", "--scene", "mine", "--out", out / "d")
        cli("fit", "gray", out / "d/tabletop/mine", "--out", out / "p") if mask else None

    return read


def _score(name: str) -> Callable[[Path, Path], None]:
    def read(folder: Path, out: Path) -> None:
        from graycard import open_predictions

        predictions, scene = folder / name, folder / _IN
        each(
            lambda: cli("score", predictions, scene, "--json", out / "scores.json"),
            lambda: open_predictions(predictions).unknown_channels(),
        )

    return read


_OUTPUTS = (
    "depth=depth_{view}.npy:z", "roughness=rough_{view}.npz", "base_color=albedo_{view}.png:srgb",
    "metallic=metal_{view}.tiff", "normal=normal_{view}.exr:world", "radiance=light_{view}.npy.gz:linear",
)  # fmt: skip


def _adopt(folder: Path, out: Path) -> None:
    outputs, scene = folder / "outputs", folder / _IN
    common = ("--views", "test", "--out", out / "p", "--map")
    each(
        lambda: cli("adopt", outputs, scene, *common, *_OUTPUTS),
        *(lambda m=text: cli("adopt", outputs, scene, *common, m) for text in _OUTPUTS),
    )


def _held_out(folder: Path, out: Path) -> None:
    scene = out / "d" / "tabletop" / "mine"
    cli("import", folder / "held-out", "--track", "tabletop", "--scene", "mine", "--out", out / "d")
    cli("fit", "gray", scene, "--out", out / "p")
    each(
        lambda: cli("score", out / "p", scene, "--json", out / "scores.json"),
        lambda: cli("report", scene, "--predictions", f"gray={out / 'p'}"),
    )


def _fit(method: str) -> Callable[[Path, Path], None]:
    def read(folder: Path, out: Path) -> None:
        from graycard import open_capture
        from graycard.benchmarks import FitSpec, fit_scene
        from graycard.eval import score_predictions
        from graycard.io import silent

        scene, done = folder / _IN, folder / "gray"
        each(
            lambda: open_capture(scene / "capture").points(),
            lambda: fit_scene(FitSpec(method, {}, 0, scene), out / "p", silent),
            lambda: score_predictions(done, scene),
        )

    return read


def _dataset(folder: Path, out: Path) -> None:
    scene = folder / "dataset" / "tabletop" / _IN
    each(
        lambda: cli("look", folder / "dataset", "--out", out / "look"),
        lambda: cli("verify", folder / "dataset", "--no-render", "--json", out / "verify.json"),
        lambda: cli("export", scene, "--format", "colmap", "--out", out / "colmap"),
        lambda: cli("export", scene, "--format", "nerfstudio", "--out", out / "nerfstudio"),
    )


def _attack_dataset(rng: Random, folder: Path) -> str:
    track = rng.choice(("tabletop", "tabletop", "multilight"))
    return any_file(f"dataset/{track}/{_IN}/{rng.choice(('capture', 'truth'))}")(rng, folder)


def _seal_dataset(folder: Path) -> None:
    for part in (folder / "dataset").glob("*/*/*"):
        seal(part)


_WITH_GRAY = SCENE, "predictions/gray"
_CAPTURE, _TRUTH = f"{_IN}/capture", f"{_IN}/truth"
DATA = (
    Kind(
        "exr",
        (f"{SCENE}/truth/views/test_001.exr", f"{SCENE}/capture/photographs/train_000.exr"),
        one_of("*.exr", attack_exr),
        _read_layers,
        weight=16,
    ),
    Kind(
        "ply",
        (f"{SCENE}/capture/points.ply",),
        one_of("*.ply", attack_bytes, attack_lines),
        _read_points,
        weight=16,
    ),
    Kind("splat", ("splats",), one_of("*/*", attack_bytes, attack_lines), _read_splat, weight=8),
    Kind(
        "import: transforms.json",
        ("nerfstudio",),
        one_of("*/transforms.json", attack_json),
        _import("nerfstudio"),
        weight=2,
    ),
    Kind(
        "import: png and masks", ("nerfstudio",), one_of("*/*/*.png", attack_picture), _import("nerfstudio")
    ),
    Kind("import: jpeg", ("jpeg",), one_of("*/*/*.jpg", attack_picture), _import("jpeg")),
    Kind(
        "import: points",
        ("nerfstudio",),
        one_of("*/*.ply", attack_lines, attack_bytes),
        _import("nerfstudio"),
    ),
    Kind(
        "import: colmap text",
        ("colmap",),
        one_of("*/**/*.txt", attack_lines, attack_lines, attack_bytes),
        _import("colmap"),
        weight=2,
    ),
    Kind(
        "import: colmap binary",
        ("colmap-binary",),
        one_of("*/**/*.bin", attack_bytes),
        _import("colmap-binary"),
        weight=2,
    ),
    Kind("import: blender", ("blender",), one_of("*/*.json", attack_json), _import("blender")),
    Kind("import: tensoir", ("tensoir",), one_of("*/*/*.json", attack_json), _import("tensoir")),
    Kind("import: true layers", ("tensoir",), one_of("*/*/*.png", attack_picture), _import("tensoir")),
    Kind(
        "import: folders",
        ("nerfstudio", "colmap"),
        any_file(),
        lambda f, o: each(lambda: _import("nerfstudio")(f, o), lambda: _import("colmap")(f, o / "second")),
    ),
    Kind(
        "adopt: pictures and arrays",
        ("outputs", SCENE),
        one_of("outputs/*", attack_bytes, attack_bytes, attack_file),
        _adopt,
        weight=4,
    ),
    Kind("adopt: exr", ("outputs", SCENE), one_of("outputs/*.exr", attack_exr), _adopt, weight=2),
    Kind("adopt: png", ("outputs", SCENE), one_of("outputs/*.png", attack_picture), _adopt, weight=2),
    Kind("adopt: folders", ("outputs", SCENE), any_file("outputs"), _adopt),
    Kind("held-out photographs", ("held-out",), one_of("*/images/test*.png", attack_picture), _held_out),
    Kind(
        "predictions: json",
        ("predictions/truth", SCENE),
        one_of("truth/*.json", attack_json),
        _score("truth"),
    ),
    Kind(
        "predictions: exr",
        ("predictions/truth", SCENE),
        one_of("truth/**/*.exr", attack_exr, attack_pixels),
        _score("truth"),
    ),
    Kind("predictions: folders", ("predictions/truth", SCENE), any_file("truth"), _score("truth")),
    Kind(
        "capture.json",
        _WITH_GRAY,
        one_of(f"{_CAPTURE}/capture.json", attack_json),
        _fit("gray"),
        sealed(_CAPTURE),
        weight=2,
    ),
    Kind("capture: manifest", _WITH_GRAY, one_of(f"{_CAPTURE}/manifest.json", attack_json), _fit("gray")),
    Kind(
        "capture: photographs",
        _WITH_GRAY,
        one_of(f"{_CAPTURE}/*/*.exr", attack_exr, attack_pixels),
        _fit("input"),
        sealed(_CAPTURE),
    ),
    Kind("capture: folders", _WITH_GRAY, any_file(_CAPTURE), _fit("retinex"), sealed(_CAPTURE)),
    Kind(
        "truth: json",
        _WITH_GRAY,
        one_of(f"{_TRUTH}/**/[!m]*.json", attack_json),
        _fit("truth"),
        sealed(_TRUTH),
        weight=2,
    ),
    Kind("truth: manifest", _WITH_GRAY, one_of(f"{_TRUTH}/manifest.json", attack_json), _fit("truth")),
    Kind(
        "truth: exr",
        _WITH_GRAY,
        one_of(f"{_TRUTH}/**/*.exr", attack_exr, attack_pixels),
        _fit("truth"),
        sealed(_TRUTH),
    ),
    Kind("truth: folders", _WITH_GRAY, any_file(_TRUTH), _fit("truth"), sealed(_TRUTH)),
    Kind("dataset: look, verify, export", ("dataset",), _attack_dataset, _dataset, _seal_dataset),
)
