# SPDX-License-Identifier: Apache-2.0
"""Pictures of other programs in PNG, JPEG, TIFF and EXR: their light, and what was done to it."""

from graycard.exchange.pictures._exposures import exposures_beside as exposures_beside
from graycard.exchange.pictures._exposures import relative_exposures as relative_exposures
from graycard.exchange.pictures._files import SUFFIXES as SUFFIXES
from graycard.exchange.pictures._files import Files as Files
from graycard.exchange.pictures._files import find_picture as find_picture
from graycard.exchange.pictures._light import Background as Background
from graycard.exchange.pictures._light import to_light as to_light
from graycard.exchange.pictures._masks import ANY_KIND as ANY_KIND
from graycard.exchange.pictures._masks import MaskKind as MaskKind
from graycard.exchange.pictures._photographs import FoundPicture as FoundPicture
from graycard.exchange.pictures._photographs import Orientation as Orientation
from graycard.exchange.pictures._photographs import Picture as Picture
from graycard.exchange.pictures._photographs import find_photographs as find_photographs
from graycard.exchange.pictures._photographs import look_at_masks as look_at_masks
from graycard.exchange.pictures._photographs import read_header as read_header
from graycard.exchange.pictures._photographs import read_mask as read_mask
from graycard.exchange.pictures._photographs import read_photograph as read_photograph
from graycard.exchange.pictures._photographs import read_pixels as read_pixels
from graycard.exchange.pictures._pixels import Encoding as Encoding
from graycard.exchange.pictures._pixels import Exposure as Exposure
from graycard.exchange.pictures._pixels import Header as Header
from graycard.exchange.pictures._pixels import Note as Note
from graycard.exchange.pictures._pixels import Pixels as Pixels
from graycard.exchange.pictures._sense import MaskObject as MaskObject
from graycard.exchange.pictures._sense import MaskShape as MaskShape
from graycard.exchange.pictures._sense import judge_masks as judge_masks
from graycard.exchange.pictures._sense import shape_of_mask as shape_of_mask
