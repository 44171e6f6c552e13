# SPDX-License-Identifier: Apache-2.0
"""Settings of ``appearance``: those of ``2dgs``, and of what tells photographs apart."""

from dataclasses import dataclass

from graycard.methods.surfels import SurfelSettings


@dataclass(frozen=True, slots=True)
class AppearanceSettings(SurfelSettings):
    """Settings of ``appearance``.

    Learning rates are given for Adam steps of which there are a hundred times fewer than in the paper.
    """

    iterations: int = 2000
    embedding: int = 32
    """Numbers that a photograph has of its own."""
    width: int = 64
    """Of both hidden layers of the network (paper: 128)."""
    embedding_rate: float = 1e-2
    """Learning rate of the embeddings (paper: 1e-3)."""
    network_rate: float = 2e-3
    """Learning rate of the network (paper: 5e-4)."""
    code_rate: float = 5e-3
    """Learning rate of the surfels' codes (paper: the same)."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        SurfelSettings.__post_init__(self)
        if self.embedding < 1 or self.width < 1:
            raise ValueError(
                f"expected 1 or more for embedding and width, got {self.embedding}, {self.width}"
            )
        rates = (self.embedding_rate, self.network_rate, self.code_rate)
        if not all(rate > 0 for rate in rates):
            raise ValueError(f"expected learning rates above 0, got {rates}")
