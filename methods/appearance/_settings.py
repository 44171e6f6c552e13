# SPDX-License-Identifier: Apache-2.0
"""Settings of ``appearance``: those of ``2dgs``, and of what tells photographs apart."""

from dataclasses import dataclass

from graycard.methods.surfels import SurfelSettings


@dataclass(frozen=True, slots=True)
class AppearanceSettings(SurfelSettings):
    """Settings of ``appearance``; learning rates are the paper's.

    A fit has a hundredth of its steps, but faster rates do held-out views no good: with embeddings ten times
    and the network four times as fast 26.3 instead of 27.2 dB (``corridor`` 1003, 2000 steps).
    """

    iterations: int = 2000
    embedding: int = 32
    """Numbers that a photograph has of its own."""
    width: int = 64
    """Width of both hidden layers of the network (paper: 128)."""
    embedding_rate: float = 1e-3
    """Learning rate of the embeddings."""
    network_rate: float = 5e-4
    """Learning rate of the network."""
    code_rate: float = 5e-3
    """Learning rate of the surfels' codes."""

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
