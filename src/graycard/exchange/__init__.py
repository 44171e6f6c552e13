# SPDX-License-Identifier: Apache-2.0
"""Captures and photographs in the formats of other programs."""

from graycard.exchange._develop_pictures import Exposures as Exposures
from graycard.exchange._develop_pictures import PictureOptions as PictureOptions
from graycard.exchange._doctor import ImportRow as ImportRow
from graycard.exchange._export import ExchangeFormat as ExchangeFormat
from graycard.exchange._export import export_capture as export_capture
from graycard.exchange._export import left_out_of as left_out_of
from graycard.exchange._find_cameras import find_cameras as find_cameras
from graycard.exchange._import import check_import as check_import
from graycard.exchange._import import import_and_tell as import_and_tell
from graycard.exchange._import import import_capture as import_capture
from graycard.exchange._import import survey_import as survey_import
from graycard.exchange._import import write_import as write_import
from graycard.exchange._photographs import write_png as write_png
from graycard.exchange._plan import ImportOptions as ImportOptions
from graycard.exchange._plan import ImportPlan as ImportPlan
from graycard.exchange._plan import plan_import as plan_import
from graycard.exchange.cards._survey import Publication as Publication
from graycard.exchange.cards._write import write_cards as write_cards
from graycard.exchange.pictures import Background as Background
from graycard.exchange.pictures import MaskObject as MaskObject
from graycard.exchange.pictures import Orientation as Orientation
