# SPDX-License-Identifier: Apache-2.0
"""A method in a process that can open nothing but its code, its libraries and its copy of a capture."""

from graycard.methods.confined._client import ConfinedMethod as ConfinedMethod
from graycard.methods.confined._client import Known as Known
from graycard.methods.confined._client import Spent as Spent
from graycard.methods.confined._introduction import Introduction as Introduction
from graycard.methods.confined._introduction import introduce as introduce
from graycard.methods.confined._introduction import introduction_as_json as introduction_as_json
from graycard.methods.confined._probe import Fact as Fact
from graycard.methods.confined._probe import serve_probe as serve_probe
from graycard.methods.confined._probed import PROBE as PROBE
from graycard.methods.confined._probed import ProbedMethod as ProbedMethod
from graycard.methods.confined._probed import of_kind as of_kind
from graycard.methods.confined._program import OUTPUTS as OUTPUTS
from graycard.methods.confined._program import Ran as Ran
from graycard.methods.confined._saved import end_of_file as end_of_file
from graycard.methods.confined._saved import take_files as take_files
from graycard.methods.confined._server import serve as serve
from graycard.methods.confined._start import SERVE as SERVE
from graycard.methods.confined._start import confined as confined
