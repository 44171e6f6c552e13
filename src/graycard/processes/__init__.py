# SPDX-License-Identifier: Apache-2.0
"""Work in processes of its own: what ends there ends nothing else, and leaves nothing behind.

:func:`run_all` does jobs in workers. :func:`started` gives a process that is to run code of others: confined,
it opens no file but those that it is told.
"""

from graycard.processes._channel import Channel as Channel
from graycard.processes._channel import ChannelError as ChannelError
from graycard.processes._channel import Message as Message
from graycard.processes._confined import AUDIT_HOOK as AUDIT_HOOK
from graycard.processes._confined import SECCOMP as SECCOMP
from graycard.processes._confined import Confined as Confined
from graycard.processes._confined import start_ahead as start_ahead
from graycard.processes._confined import started as started
from graycard.processes._confined import words_of_end as words_of_end
from graycard.processes._inside import serve_starts as serve_starts
from graycard.processes._landlock import landlock_version as landlock_version
from graycard.processes._outcome import Ended as Ended
from graycard.processes._outcome import Outcome as Outcome
from graycard.processes._outcome import named as named
from graycard.processes._outcome import narrowed as narrowed
from graycard.processes._outcome import part_of as part_of
from graycard.processes._places import Places as Places
from graycard.processes._pool import USUAL as USUAL
from graycard.processes._pool import Limits as Limits
from graycard.processes._pool import StandingWorker as StandingWorker
from graycard.processes._pool import run_all as run_all
from graycard.processes._worker import worker_progress as worker_progress
