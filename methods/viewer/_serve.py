# SPDX-License-Identifier: Apache-2.0
"""The web viewer: viser shows surfels in the browser, this process draws layers behind them.

The page is served to this machine alone: there is no password, and whoever sees it sees the scene.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from graycard import Camera, MethodError
from graycard.methods.splat import SH_DC, rotation_matrices
from graycard.methods.trained import TrainedSplat
from graycard.methods.viewer._orbit import orbit
from graycard.methods.viewer._preview import preview
from graycard.methods.viewer._saved import Fitted

if TYPE_CHECKING:
    from viser import CameraHandle, ViserServer  # pyright: ignore[reportMissingImports]

SURFELS = "surfels"
"""Choice of what is shown that needs no drawing here."""
HOST = "127.0.0.1"
SIDE = 384
"""Pixels of the height of pictures that are drawn for the browser."""
FLAT = 1e-4
"""Metres: thickness of a disc for a viewer that knows ellipsoids."""


def serve_fitted(fitted: Fitted, cameras: Mapping[str, Camera], port: int) -> ViserServer:
    """Show fitted surfels; layers are drawn for the camera of each browser when it moves.

    Args:
        fitted: A saved decomposition.
        cameras: Of the photographs, by name; drawn as pyramids.
        port: Of the page; the next free one is taken.

    Returns:
        The server, which works until it is stopped.

    Raises:
        MethodError: viser is not installed.
    """
    server = _server(port)
    handle = server.scene.add_gaussian_splats(f"/{SURFELS}", **_splats(fitted.surfels))
    _add_cameras(server, cameras)
    layers = sorted(fitted.decomposition.provides)
    choice = server.gui.add_dropdown("Show", (SURFELS, *layers), initial_value=SURFELS)
    first = orbit(fitted.surfels.shapes.centres.numpy(), 1, SIDE, list(cameras.values()))[0]

    def draw(client: Any) -> None:
        handle.visible = choice.value == SURFELS
        if choice.value == SURFELS:
            client.scene.set_background_image(None)
            return
        with torch.no_grad():
            values = fitted.decomposition.render(_camera_of(client.camera), [choice.value])[choice.value]
        client.scene.set_background_image(preview(choice.value, values), format="jpeg")

    @choice.on_update
    def _(_event: Any) -> None:
        for client in server.get_clients().values():
            draw(client)

    @server.on_client_connect
    def _(client: Any) -> None:
        client.camera.position, client.camera.look_at = first.position, first.position + first.forward
        client.camera.on_update(lambda _: draw(client))

    return server


def serve_pictures(
    pictures: Mapping[str, Mapping[str, np.ndarray]], cameras: Mapping[str, Camera], port: int
) -> ViserServer:
    """Show pictures of a predictions folder, each at its camera if that is known.

    Args:
        pictures: uint8 ``(H, W, 3)`` by view and layer.
        cameras: By name of the view; may lack some.
        port: Of the page; the next free one is taken.

    Raises:
        MethodError: viser is not installed, or there are no pictures.
    """
    if not pictures or not all(pictures.values()):
        raise MethodError("expected predictions with layers to show, got none. Give another folder")
    server = _server(port)
    layers = sorted({layer for found in pictures.values() for layer in found})
    start = "radiance" if "radiance" in layers else layers[0]
    view = server.gui.add_dropdown("View", tuple(pictures), initial_value=next(iter(pictures)))
    layer = server.gui.add_dropdown("Layer", tuple(layers), initial_value=start)

    def show() -> None:
        server.scene.set_background_image(pictures[view.value].get(layer.value), format="png")
        _add_cameras(server, cameras, {name: found.get(layer.value) for name, found in pictures.items()})

    view.on_update(lambda _: show())
    layer.on_update(lambda _: show())
    show()
    return server


def _server(port: int) -> ViserServer:
    try:
        import viser  # pyright: ignore[reportMissingImports]  # of the extra 'view'
    except ImportError as cause:
        raise MethodError(
            "expected viser, which serves the page, got none. Run pip install 'graycard[view]'"
        ) from cause
    server = viser.ViserServer(host=HOST, port=port, label="graycard", verbose=False)
    server.scene.set_up_direction("+z")
    return server


def _splats(splat: TrainedSplat) -> dict[str, Any]:
    """Ellipsoids as viser takes them: one colour each, whatever the direction."""
    shapes = splat.shapes
    sizes = torch.nn.functional.pad(shapes.scales, (0, 3 - shapes.scales.shape[1]), value=FLAT)
    axes = rotation_matrices(shapes.rotations) * sizes[:, None]
    return {
        "centers": shapes.centres.numpy(),
        "covariances": (axes @ axes.mT).numpy(),
        "rgbs": (0.5 + SH_DC * splat.coefficients[:, 0]).clamp(0, 1).numpy(),
        "opacities": shapes.opacities[:, None].numpy(),
    }


def _add_cameras(
    server: ViserServer, cameras: Mapping[str, Camera], images: Mapping[str, np.ndarray | None] | None = None
) -> None:
    """Draw pyramids of cameras, with a picture in each that has one."""
    for name, camera in cameras.items():
        server.scene.add_camera_frustum(
            f"/cameras/{name}",
            fov=float(2 * np.arctan(0.5 * camera.height / camera.K[1, 1])),
            aspect=camera.width / camera.height,
            scale=0.1,
            image=(images or {}).get(name),
            wxyz=_quaternion(camera),
            position=camera.position,
        )


def _quaternion(camera: Camera) -> Sequence[float]:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(camera.camera_to_world[:3, :3]).as_quat(scalar_first=True).tolist()


def _camera_of(seen: CameraHandle) -> Camera:
    """The camera of a browser; viser's axes are those of OpenCV."""
    from scipy.spatial.transform import Rotation

    width, pose = max(int(SIDE * seen.aspect), 1), np.eye(4)
    pose[:3, :3] = Rotation.from_quat(seen.wxyz, scalar_first=True).as_matrix()
    pose[:3, 3] = seen.position
    focal = 0.5 * SIDE / np.tan(seen.fov / 2)
    return Camera(width, SIDE, np.array([[focal, 0, width / 2], [0, focal, SIDE / 2], [0, 0, 1]]), pose)
