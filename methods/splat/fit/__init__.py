# SPDX-License-Identifier: Apache-2.0
"""Fitting: parameters, optimiser, densification, checkpoints and the training loop."""
