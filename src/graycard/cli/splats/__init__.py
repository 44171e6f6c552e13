# SPDX-License-Identifier: Apache-2.0
"""The verbs for splats: score those of other programs, look at fitted ones."""

from graycard.cli.splats._export import export_surfels as export_surfels
from graycard.cli.splats._look import TurntableCommand as TurntableCommand
from graycard.cli.splats._look import ViewCommand as ViewCommand
from graycard.cli.splats._splat import SplatCommand as SplatCommand
