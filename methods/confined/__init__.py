# SPDX-License-Identifier: Apache-2.0
"""A method in a process that can open nothing but its code, its libraries and its copy of a capture."""

from graycard.methods.confined._client import SERVE as SERVE
from graycard.methods.confined._client import ConfinedMethod as ConfinedMethod
from graycard.methods.confined._client import Known as Known
from graycard.methods.confined._client import Spent as Spent
from graycard.methods.confined._client import confined as confined
from graycard.methods.confined._introduction import Introduction as Introduction
from graycard.methods.confined._introduction import introduce as introduce
from graycard.methods.confined._introduction import introduction_as_json as introduction_as_json
from graycard.methods.confined._server import serve as serve
