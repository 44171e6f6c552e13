# SPDX-License-Identifier: Apache-2.0
"""The truth proves itself: checks of a dataset by integrity, geometry, physics and a second rendering.

Importing this package does not import Mitsuba; :func:`verify_dataset` does when there is something to render.
"""

from graycard.synth.verify._check import Check as Check
from graycard.synth.verify._check import Status as Status
from graycard.synth.verify._check import worst as worst
from graycard.synth.verify._run import VerifyVerdict as VerifyVerdict
from graycard.synth.verify._run import verify_dataset as verify_dataset
