# SPDX-License-Identifier: Apache-2.0
"""The verbs for splats: score those of other programs, look at fitted ones."""

from graycard.cli.splats._splat import SplatCommand as SplatCommand
