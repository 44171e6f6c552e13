# SPDX-License-Identifier: Apache-2.0
"""Adoption: outputs of other code turned into a predictions folder, with every convention declared."""

from graycard.adoption._adopt import Adopted as Adopted
from graycard.adoption._adopt import AdoptedLayer as AdoptedLayer
from graycard.adoption._adopt import Request as Request
from graycard.adoption._adopt import adopt as adopt
from graycard.adoption._adopt import request_of as request_of
from graycard.adoption._declared import MEANINGS as MEANINGS
from graycard.adoption._declared import LayerMap as LayerMap
from graycard.adoption._declared import parse_map as parse_map
from graycard.adoption._declared import times_word as times_word
from graycard.adoption._layouts import LAYOUTS as LAYOUTS
from graycard.adoption._layouts import Layout as Layout
from graycard.adoption._layouts import Views as Views
from graycard.adoption._layouts import find_layout as find_layout
