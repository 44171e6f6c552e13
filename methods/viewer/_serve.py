# SPDX-License-Identifier: Apache-2.0
"""The web viewer: viser shows surfels in the browser, this process draws layers behind them.

The page is served to this machine alone: there is no password, and whoever sees it sees the scene.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from graycard import Camera, GraycardError, MethodError, Predictions
from graycard.methods.splat import SH_DC, rotation_matrices
from graycard.methods.trained import TrainedSplat
from graycard.methods.viewer._orbit import orbit, up_of
from graycard.methods.viewer._preview import preview
from graycard.methods.viewer._saved import Fitted
from graycard.methods.viewer._turns import Turns

if TYPE_CHECKING:
    from viser import CameraFrustumHandle, CameraHandle, ClientHandle, ViserServer

SURFELS = "surfels"
"""Choice of what is shown that needs no drawing here."""
HOST = "127.0.0.1"
SIDE = 384
"""Pixels of the height of pictures that are drawn for the browser."""
FLAT = 1e-4
"""Metres: thickness of a disc for a viewer that knows ellipsoids."""
_MARKUP = re.compile(r"[\\`*_{}\[\]<>#]")
"""Signs that would not be shown as they are."""


def serve_fitted(fitted: Fitted, cameras: Mapping[str, Camera], port: int) -> ViserServer:
    """Show fitted surfels; layers are drawn for the camera of each browser when it moves.

    Args:
        fitted: A saved decomposition.
        cameras: Of the photographs, by name; drawn as pyramids. What is up in them is up on the page.
        port: Of the page; the next free one is taken.

    Returns:
        The server, which works until it is stopped.

    Raises:
        MethodError: viser is not installed.
    """
    server, turns = _server(port, cameras), Turns()
    handle = server.scene.add_gaussian_splats(f"/{SURFELS}", **_splats(fitted.surfels))
    _add_cameras(server, cameras)
    layers = sorted(fitted.decomposition.provides)
    choice = server.gui.add_dropdown("Show", (SURFELS, *layers), initial_value=SURFELS)
    first = orbit(fitted.surfels.shapes.centres.numpy(), 1, SIDE, list(cameras.values()))[0]

    def draw(client: ClientHandle) -> None:
        layer = choice.value
        handle.visible = layer == SURFELS
        if layer == SURFELS:
            client.scene.set_background_image(None)
            return
        with torch.no_grad():
            values = fitted.decomposition.render(_camera_of(client.camera), [layer])[layer]
        client.scene.set_background_image(preview(layer, values), format="jpeg")

    def ask(client: ClientHandle) -> None:
        turns.run(client.client_id, lambda: draw(client))

    @choice.on_update
    def _(_event: object) -> None:
        for client in server.get_clients().values():
            ask(client)

    @server.on_client_connect
    def _(client: ClientHandle) -> None:
        client.camera.up_direction = up_of(list(cameras.values()))
        client.camera.position, client.camera.look_at = first.position, first.position + first.forward
        client.camera.on_update(lambda _: ask(client))

    return server


def serve_pictures(predictions: Predictions, cameras: Mapping[str, Camera], port: int) -> ViserServer:
    """Show pictures of a predictions folder, each at its camera if that is known.

    A view is read when it is chosen: all of them may be more than the memory holds.

    Args:
        predictions: That were opened from a folder.
        cameras: By name of the view; may lack some.
        port: Of the page; the next free one is taken.

    Raises:
        MethodError: viser is not installed, or there are no pictures.
        PredictionError: The first view cannot be read. The page says it of others.
    """
    names = predictions.view_names()
    if not names:
        raise MethodError("expected predictions with layers to show, got none. Give another folder")
    read = lru_cache(maxsize=2)(predictions.layers)
    layers = sorted(read(names[0]))
    server, turns = _server(port, cameras), Turns()
    pyramids = _add_cameras(server, cameras)
    view = server.gui.add_dropdown("View", names, initial_value=names[0])
    layer = server.gui.add_dropdown(
        "Layer", layers, initial_value="radiance" if "radiance" in layers else layers[0]
    )
    fault = server.gui.add_markdown("")

    def show() -> None:
        try:
            found, fault.content = read(view.value), ""
        except GraycardError as cause:
            found, fault.content = {}, _MARKUP.sub(r"\\\g<0>", str(cause))
        if found and sorted(found) != list(layer.options):
            layer.options = sorted(found)  # keeps the choice where it can
        picture = preview(layer.value, found[layer.value]) if layer.value in found else None
        server.scene.set_background_image(picture, format="png")
        for name, pyramid in pyramids.items():
            if pyramid.image is not None or name == view.value:
                pyramid.image = picture if name == view.value else None

    for choice in (view, layer):
        choice.on_update(lambda _: turns.run("page", show))
    show()
    return server


def _server(port: int, cameras: Mapping[str, Camera]) -> ViserServer:
    try:
        import viser
    except ImportError as cause:
        raise MethodError(
            f"expected viser, which serves the page, got none: {cause}. Run pip install 'graycard[view]'"
        ) from None  # a traceback would tell no more
    server = viser.ViserServer(host=HOST, port=port, label="graycard", verbose=False)
    server.scene.set_up_direction(up_of(list(cameras.values())))
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


def _add_cameras(server: ViserServer, cameras: Mapping[str, Camera]) -> dict[str, CameraFrustumHandle]:
    """Draw pyramids of cameras; return them by name."""
    return {
        name: server.scene.add_camera_frustum(
            f"/cameras/{name}",
            fov=float(2 * np.arctan(0.5 * camera.height / camera.K[1, 1])),
            aspect=camera.width / camera.height,
            scale=0.1,
            wxyz=_quaternion(camera),
            position=camera.position,
        )
        for name, camera in cameras.items()
    }


def _quaternion(camera: Camera) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(camera.camera_to_world[:3, :3]).as_quat(scalar_first=True)


def _camera_of(seen: CameraHandle) -> Camera:
    """Return the camera of a browser; viser's axes are those of OpenCV."""
    from scipy.spatial.transform import Rotation

    width, pose = max(int(SIDE * seen.aspect), 1), np.eye(4)
    pose[:3, :3] = Rotation.from_quat(seen.wxyz, scalar_first=True).as_matrix()
    pose[:3, 3] = seen.position
    focal = 0.5 * SIDE / np.tan(seen.fov / 2)
    return Camera(width, SIDE, np.array([[focal, 0, width / 2], [0, focal, SIDE / 2], [0, 0, 1]]), pose)
