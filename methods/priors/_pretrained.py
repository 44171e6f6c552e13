# SPDX-License-Identifier: Apache-2.0
"""Networks whose weights the user has on disk; nothing is ever downloaded."""

from pathlib import Path

from graycard import MethodError
from graycard.methods._priors import ImageKind, PriorModel
from graycard.methods.priors._own import load_own
from graycard.methods.priors._torchscript import InpaintingNetwork, ScriptedNetwork, load_torchscript
from graycard.methods.priors._transformers import DepthNetwork, load_depth_network

OF_DEPTH = ("depth", "normal")


def load_pretrained(kind: ImageKind, weights: Path) -> PriorModel:
    """Return the network that answers about a kind.

    Args:
        kind: The kind.
        weights: A folder is a checkpoint of ``transformers`` for depth; asked for normals, it gives those of
            its depth. A file is a TorchScript module, or graycard's own network where its name ends in
            ``.safetensors``.

    Raises:
        MethodError: The weights are damaged, or those of no network for this kind.
    """
    if weights.suffix == ".safetensors":
        return load_own(kind, weights)
    if not weights.is_dir():
        module = load_torchscript(weights)
        return InpaintingNetwork(module) if kind == "inpainting" else ScriptedNetwork(kind, module)
    if kind not in OF_DEPTH:
        raise MethodError(
            f"expected a TorchScript file for {kind} priors, got the folder {weights}: of transformers, only "
            "networks for depth are run (for depth, and for normals from it)"
        )
    return DepthNetwork(*load_depth_network(weights))
