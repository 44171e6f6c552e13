# SPDX-License-Identifier: Apache-2.0
"""Folders as published code writes them.

Each is read off the script that its source names, at the commit that it names. Light is ``exposed``
throughout: such code was trained on photographs of ``graycard export``, radiance times the exposure. For
imported captures, whose photographs were given to it as they were, the word is left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from graycard._errors import UnknownNameError

Views = Literal["all", "train", "test"]


@dataclass(frozen=True, slots=True)
class Layout:
    """Places and conventions of one program's outputs."""

    name: str
    title: str
    folder: str
    """The folder that is meant, in the words of the program."""
    maps: tuple[str, ...]
    """Declarations, as of ``--map``; of several for one layer the first that has files is taken."""
    source: str
    """Repository, file and commit that the layout was read off."""
    views: Views = "all"
    note: str = ""
    of_photographs: bool = True
    """True where it opens a photograph for each view, which exported scenes lack for held-out views."""


_LAYOUTS = (
    # train.py and render.py of 3D Gaussian Splatting: sRGB in, sRGB out, numbered by split.
    Layout(
        "3dgs-render",
        "3D Gaussian Splatting: render.py",
        "the model path (-m)",
        ("radiance={split}/ours_*/renders/{index:05d}.png:srgb:exposed",),
        "graphdeco-inria/gaussian-splatting, render.py, render_set, 1152adc",
    ),
    # export_image writes 8-bit normals of the world that are turned to the camera, and depth as it is.
    Layout(
        "2dgs-render",
        "2D Gaussian Splatting: render.py",
        "the model path (-m)",
        (
            "radiance={split}/ours_*/renders/{index:05d}.png:srgb:exposed",
            "normal={split}/ours_*/vis/normal_{index:05d}.png:world:coded",
            "depth={split}/ours_*/vis/depth_{index:05d}.tiff:z",
        ),
        "hbb1/2d-gaussian-splatting, utils/mesh_utils.py, export_image, 0735f1e",
    ),
    # render_set --pbr --gamma puts albedo, roughness and metallic side by side, as they are in shading.
    Layout(
        "gs-ir",
        "GS-IR: render.py --pbr --gamma",
        "the model path (-m)",
        (
            "radiance={split}/ours_*/pbr/{index:05d}.png:srgb:exposed",
            "base_color={split}/ours_*/pbr/{index:05d}_brdf.png:panel=1/3:linear",
            "roughness={split}/ours_*/pbr/{index:05d}_brdf.png:panel=2/3:linear",
            "metallic={split}/ours_*/pbr/{index:05d}_brdf.png:panel=3/3:linear",
            "normal={split}/ours_*/normal/{index:05d}_normal.png:world:coded",
        ),
        "lzhnb/GS-IR, render.py, render_set, 0d8c1ea",
        note="without --gamma the pictures are linear: --map radiance=:linear:exposed; metallic is one "
        "number everywhere unless --metallic was given",
    ),
    # eval_nvs.py writes base colour through rgb_to_srgb of gaussian_renderer/neilf.py, normals of the world.
    Layout(
        "r3dg",
        "Relightable 3D Gaussian: eval_nvs.py -t neilf",
        "the model path (-m)",
        (
            "radiance={split}/ours_*/renders/{index:05d}.png:srgb:exposed",
            "base_color={split}/ours_*/base_color/{index:05d}.png:srgb",
            "roughness={split}/ours_*/roughness/{index:05d}.png:linear",
            "normal={split}/ours_*/normal/{index:05d}.png:world:coded",
        ),
        "NJU-3DV/Relightable3DGaussian, eval_nvs.py and gaussian_renderer/neilf.py, 213a475",
    ),
    # evaluation_iter_TensoIR puts predictions and truth side by side; albedo there has no gamma, and the
    # pictures went through linear2srgb_torch of models/relight_utils.py.
    Layout(
        "tensoir",
        "TensoIR: evaluation of all test views",
        "the folder imgs_test_all of the experiment",
        (
            "radiance=nvs_with_brdf/*{index:03d}.png:panel=1/2:srgb:exposed",
            "base_color=brdf/*{index:03d}.png:panel=1/3:linear",
            "roughness=brdf/*{index:03d}.png:panel=2/3:linear",
            "f0=brdf/*{index:03d}.png:panel=3/3:linear",
            "normal=normal/*{index:03d}.png:panel=1/4:world:coded",
        ),
        "Haian-Jin/TensoIR, renderer.py, evaluation_iter_TensoIR, 0ce4aa7",
        views="test",
        of_photographs=False,  # `graycard export --format tensoir` has pictures of held-out views
        note="where the capture had no truth, normal has three panels: --map "
        "normal=normal/*{index:03d}.png:panel=1/3:world:coded",
    ),
    # DatasetRender names files after the photographs; raw- outputs are float32 in gzip.
    Layout(
        "nerfstudio-render",
        "nerfstudio: ns-render dataset of splatfacto",
        "the folder of --output-path",
        (
            "radiance={split}/raw-rgb/{view}.npy.gz:srgb:exposed",
            "radiance={split}/rgb/{view}.png:srgb:exposed",
            "radiance={split}/rgb/{view}.jpg:srgb:exposed",
            "depth={split}/raw-depth/{view}.npy.gz:z",
        ),
        "nerfstudio-project/nerfstudio, nerfstudio/scripts/render.py, DatasetRender, 002ab79",
        note="ask for raw-rgb and raw-depth by --rendered-output-names and --split train+test",
    ),
    # NeRF models of nerfstudio sum distances along rays; splatfacto has z.
    Layout(
        "nerfstudio-nerf-render",
        "nerfstudio: ns-render dataset of nerfacto and other fields",
        "the folder of --output-path",
        (
            "radiance={split}/raw-rgb/{view}.npy.gz:srgb:exposed",
            "radiance={split}/rgb/{view}.png:srgb:exposed",
            "radiance={split}/rgb/{view}.jpg:srgb:exposed",
            "depth={split}/raw-depth/{view}.npy.gz:distance",
        ),
        "nerfstudio-project/nerfstudio, nerfstudio/scripts/render.py, DatasetRender, 002ab79",
        note="ask for raw-rgb and raw-depth by --rendered-output-names and --split train+test",
    ),
    # _save_predictions_iterate writes colours of the test views after the names of their photographs.
    Layout(
        "nerfbaselines",
        "NerfBaselines: nerfbaselines render",
        "the folder of --output",
        ("radiance=color/{view}.png:srgb:exposed",),
        "nerfbaselines/nerfbaselines, nerfbaselines/io.py, _save_predictions_iterate, befbbd5",
        views="test",
        note="its depth is half precision in a format of its own, along z or the ray by the method: left out",
    ),
    # Runner.eval puts photograph and picture side by side.
    Layout(
        "gsplat",
        "gsplat: examples/simple_trainer.py",
        "the folder of --result_dir",
        ("radiance=renders/val_step*_{index:04d}.png:panel=2/2:srgb:exposed",),
        "nerfstudio-project/gsplat, examples/simple_trainer.py, Runner.eval, 00877bf",
        views="test",
        note="it evaluates at several steps: name one by --star 29999; its views are each 8th of the "
        "photographs in its folder, as `graycard import` holds them out",
    ),
)
LAYOUTS: Mapping[str, Layout] = {layout.name: layout for layout in _LAYOUTS}
"""All layouts by name."""


def find_layout(name: str) -> Layout:
    """Return the layout of a name.

    Raises:
        UnknownNameError: There is none.
    """
    if name not in LAYOUTS:
        raise UnknownNameError("layout", name, LAYOUTS, "Or name the files of each layer by --map")
    return LAYOUTS[name]
