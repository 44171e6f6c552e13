# SPDX-License-Identifier: Apache-2.0
"""A machine without LLVM, in a process in which other tests may need it."""

import pytest

from graycard.synth import use_renderer


def hide_llvm(patch: pytest.MonkeyPatch) -> None:
    """Let graycard find no LLVM until the patch is undone.

    Dr.Jit looks for it once in a process, so it looks before: later tests would be skipped, or fail.
    """
    use_renderer()
    patch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so.19.1")
