# SPDX-License-Identifier: Apache-2.0
"""Captures and photographs in the formats of other programs."""

from graycard.exchange._develop_pictures import Exposures as Exposures
from graycard.exchange._develop_pictures import PictureOptions as PictureOptions
from graycard.exchange._doctor import ImportRow as ImportRow
from graycard.exchange._photographs import write_png as write_png
from graycard.exchange._transfer import ExchangeFormat as ExchangeFormat
from graycard.exchange._transfer import export_capture as export_capture
from graycard.exchange._transfer import import_and_tell as import_and_tell
from graycard.exchange._transfer import import_capture as import_capture
from graycard.exchange.pictures import Background as Background
from graycard.exchange.pictures import MaskObject as MaskObject
from graycard.exchange.pictures import Orientation as Orientation
