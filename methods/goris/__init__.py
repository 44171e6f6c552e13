# SPDX-License-Identifier: Apache-2.0
"""``goris``: an object is removed together with its reflection (GOR-IS, CVPR 2026)."""

from graycard.methods.goris._method import GorisMethod as GorisMethod
from graycard.methods.goris._remove import RemovalMasks as RemovalMasks
from graycard.methods.goris._scene import DistilledScene as DistilledScene
from graycard.methods.goris._scene import GlossyScene as GlossyScene
from graycard.methods.goris._scene import GorisScene as GorisScene
from graycard.methods.goris._settings import GorisSettings as GorisSettings
