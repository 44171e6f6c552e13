# SPDX-License-Identifier: Apache-2.0
"""Monocular depth by networks of ``transformers``: Depth Pro, Depth Anything, DPT and their like."""

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch

from graycard import MethodError, srgb_encode
from graycard.methods._priors import Question
from graycard.methods.priors._slopes import normals_of

FARTHEST = 100.0
"""Ratio: how many times the nearest depth the farthest is at most, where a network gives inverse depth up
to scale: its zero means nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthNetwork:
    """Answers about depth and normals with a network for monocular depth."""

    processor: Any
    model: Any

    def answer(self, question: Question) -> np.ndarray:
        """Depth as the network sees it, or the normals of that depth with the true camera.

        Metres from a metric network; from one of relative depth, of median 1.
        """
        depth = self._depth(srgb_encode(question.image))
        return depth if question.kind == "depth" else normals_of(depth, question.view.camera)

    def _depth(self, encoded: np.ndarray) -> np.ndarray:
        shown = np.round(255 * encoded).astype(np.uint8)
        with torch.inference_mode():
            outputs = self.model(**self.processor(images=shown, return_tensors="pt"))
            found = self.processor.post_process_depth_estimation(outputs, target_sizes=[shown.shape[:2]])
        values = found[0]["predicted_depth"].double().numpy()
        return _inverted(values) if _is_inverse(self.model.config) else values


def load_depth_network(path: Path) -> tuple[Any, Any]:
    """Return the image processor and the network in a folder.

    Raises:
        MethodError: ``transformers`` is not installed, or the folder holds no network for depth.
    """
    try:
        library = import_module("transformers")
    except ImportError as cause:
        raise MethodError(
            f"expected transformers, to run {path}, got none: {cause}. Install it: "
            "pip install 'graycard[priors]'"
        ) from None  # a traceback would tell no more
    try:
        processor = library.AutoImageProcessor.from_pretrained(str(path), local_files_only=True)
        model = library.AutoModelForDepthEstimation.from_pretrained(str(path), local_files_only=True)
    except (OSError, ValueError, KeyError, RuntimeError, ImportError) as cause:
        raise MethodError(
            f"expected a checkpoint of transformers for depth in {path}, got: {str(cause).splitlines()[0]}"
        ) from cause
    return processor, model.eval()


def _is_inverse(config: Any) -> bool:
    """Return whether a network gives inverse depth up to scale: DPT, and Depth Anything unless it is
    metric.
    """
    return config.model_type == "dpt" or getattr(config, "depth_estimation_type", "") == "relative"


def _inverted(inverse: np.ndarray) -> np.ndarray:
    """Depth of median 1 from inverse depth."""
    positive = np.maximum(inverse, max(float(inverse.max()), 1e-12) / FARTHEST)
    return np.median(positive) / positive
