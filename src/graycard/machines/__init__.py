# SPDX-License-Identifier: Apache-2.0
"""Jobs on many machines: Dask hands them out, and each runs in a worker process as on one machine."""

from graycard.machines._clusters import connected as connected
from graycard.machines._engine import Machines as Machines
from graycard.machines._spec import ClusterSpec as ClusterSpec
from graycard.machines._spec import MachineError as MachineError
from graycard.machines._spec import read_scheduler as read_scheduler
