# SPDX-License-Identifier: Apache-2.0
"""``2dgs``: surfels whose colours change with the view, fitted to photographs and nothing else."""

from graycard.methods.surfels._method import OracleSurfelMethod as OracleSurfelMethod
from graycard.methods.surfels._method import SurfelMethod as SurfelMethod
from graycard.methods.surfels._scene import SurfelScene as SurfelScene
from graycard.methods.surfels._settings import OracleSurfelSettings as OracleSurfelSettings
from graycard.methods.surfels._settings import SurfelSettings as SurfelSettings
