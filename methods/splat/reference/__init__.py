# SPDX-License-Identifier: Apache-2.0
"""The specification in plain PyTorch, which every back end is tested against."""
