# SPDX-License-Identifier: Apache-2.0
"""Start the process of a method, close to it all that it is not handed, and end it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from graycard import MethodError, Progress
from graycard.io import silent
from graycard.methods._kernel_places import SHARED_KERNELS, kernel_root, linked_gpu_kernels
from graycard.methods._registry import module_of
from graycard.methods.confined._client import ConfinedMethod
from graycard.processes import ChannelError, Places, started, words_of_end

SERVE = "graycard.methods.confined:serve"
"""Function that the process runs."""


@contextmanager
def confined(
    name: str,
    scratch: Path,
    places: Places,
    progress: Progress = silent,
    label: str = "",
    *,
    serve: str = SERVE,
    kind: type[ConfinedMethod] = ConfinedMethod,
    module: str | None = None,
) -> Iterator[ConfinedMethod]:
    """Return a process for the code of a method, which ends with the block.

    Args:
        name: A registered name or ``module:attribute``; with ``module`` any name, for messages.
        scratch: Folder of the process.
        places: What is open and what is closed to it.
        progress: Called now and then.
        label: Name in messages; that of the method if empty.
        serve: Function that the process runs, ``module:function``.
        kind: Class of what talks to it.
        module: Module whose package the process may read; that of the method if None, none if empty.

    Raises:
        UnknownNameError: No method has this name.
        MethodError: It is offered twice, or the process cannot be started.
    """
    code = module_of(name) if module is None else module
    try:
        process = started(serve)
    except OSError as cause:
        raise MethodError(f"expected room for a process, got {cause.strerror}. Try fewer --jobs") from cause
    method = kind(name, label or name, process, scratch, progress)
    try:
        kernels = str(kernel_root(os.environ.get("NUMBA_CACHE_DIR")))
        variables = {SHARED_KERNELS: kernels, "NUMBA_CACHE_DIR": str(scratch / "kernels")}
        readable = (*places.readable, kernels, *linked_gpu_kernels(scratch / "home"))
        try:
            process.confine(replace(places, readable=readable), code, variables)
        except ChannelError as cause:
            raise MethodError(
                f"expected a process for {name!r}, got {cause}. {words_of_end(process.end())}"
            ) from None
        yield method
    finally:
        process.end()
