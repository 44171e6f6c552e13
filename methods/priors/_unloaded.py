# SPDX-License-Identifier: Apache-2.0
"""A network that is not loaded yet: code of others is run where the method's code runs."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from graycard.methods._priors import ImageKind, PriorModel, Question


@dataclass(frozen=True, slots=True)
class UnloadedNetwork:
    """Weights on disk: a TorchScript file among them is a program."""

    kind: ImageKind
    weights: Path

    def load(self) -> PriorModel:
        """Return the network.

        Raises:
            MethodError: The weights are damaged, or those of no network for this kind.
        """
        from graycard.methods.priors._pretrained import load_pretrained  # PyTorch takes long to import

        return load_pretrained(self.kind, self.weights)

    def answer(self, question: Question) -> np.ndarray:
        """Return the answer, unchecked; the network is loaded for it."""
        return self.load().answer(question)
