# SPDX-License-Identifier: Apache-2.0
"""Protocols: named, versioned ways of turning layers into one number; graycard's own and published ones."""

from graycard.eval.protocols._alignment import Alignment as Alignment
from graycard.eval.protocols._base import JudgedView as JudgedView
from graycard.eval.protocols._base import JudgedViews as JudgedViews
from graycard.eval.protocols._base import Outcome as Outcome
from graycard.eval.protocols._base import Protocol as Protocol
from graycard.eval.protocols._base import PublishedProtocol as PublishedProtocol
from graycard.eval.protocols._base import Rules as Rules
from graycard.eval.protocols._base import Subject as Subject
from graycard.eval.protocols._experiment import Experiment as Experiment
from graycard.eval.protocols._experiment import albedo_views as albedo_views
from graycard.eval.protocols._experiment import protocol_spread as protocol_spread
from graycard.eval.protocols._find import ALL as ALL
from graycard.eval.protocols._find import all_protocols as all_protocols
from graycard.eval.protocols._find import find_protocols as find_protocols
from graycard.eval.protocols._geometry import AngleProtocol as AngleProtocol
from graycard.eval.protocols._geometry import CosineProtocol as CosineProtocol
from graycard.eval.protocols._geometry import DepthProtocol as DepthProtocol
from graycard.eval.protocols._graycard import GRAYCARD as GRAYCARD
from graycard.eval.protocols._lmse import LmseProtocol as LmseProtocol
from graycard.eval.protocols._materials import RoughnessProtocol as RoughnessProtocol
from graycard.eval.protocols._perceptual import LpipsProtocol as LpipsProtocol
from graycard.eval.protocols._psnr import PsnrProtocol as PsnrProtocol
from graycard.eval.protocols._scores import score_protocols as score_protocols
from graycard.eval.protocols._scores import score_views as score_views
from graycard.eval.protocols._similarity import SsimProtocol as SsimProtocol
from graycard.eval.protocols.catalogue._albedo import ALBEDO as ALBEDO
from graycard.eval.protocols.catalogue._published import FORMER as FORMER
from graycard.eval.protocols.catalogue._published import PUBLISHED as PUBLISHED
