# SPDX-License-Identifier: Apache-2.0
"""One SIGTERM is enough, wherever it comes."""

import ctypes
import os
import signal
import time

import pytest

from graycard.cli._main import _Ended, _ended_tidily


def test_a_signal_that_a_callback_of_c_swallows_comes_again(capsys: pytest.CaptureFixture[str]):
    """Compilers call Python back through ctypes, which prints an exception there and drops it."""

    def called_back() -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.01)
        pytest.fail("the handler raised nothing")

    def go_on() -> None:
        with _ended_tidily():
            ctypes.CFUNCTYPE(None)(called_back)()
            for _ in range(100):
                time.sleep(0.1)

    with pytest.raises(_Ended):
        go_on()
    assert "Exception ignored" not in capsys.readouterr().err
