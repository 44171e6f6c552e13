# SPDX-License-Identifier: Apache-2.0
"""Removal of an object by radiance alone, the baselines of GOR-IS: no light transport and no materials."""

from graycard.methods.removal._behind import NEAR as NEAR
from graycard.methods.removal._behind import RenderedView as RenderedView
from graycard.methods.removal._behind import points_in_picture as points_in_picture
from graycard.methods.removal._behind import views_behind as views_behind
from graycard.methods.removal._filled import BackgroundPoints as BackgroundPoints
from graycard.methods.removal._filled import Target as Target
from graycard.methods.removal._filled import targets_of as targets_of
from graycard.methods.removal._grouping import GroupingMethod as GroupingMethod
from graycard.methods.removal._hull import hull_holes as hull_holes
from graycard.methods.removal._method import KeepMethod as KeepMethod
from graycard.methods.removal._method import OneReferenceMethod as OneReferenceMethod
from graycard.methods.removal._method import PerViewMethod as PerViewMethod
from graycard.methods.removal._method import RemovalMethod as RemovalMethod
from graycard.methods.removal._method import wall_surfels as wall_surfels
from graycard.methods.removal._references import choice_of as choice_of
from graycard.methods.removal._scene import Emptied as Emptied
from graycard.methods.removal._scene import RemovalScene as RemovalScene
from graycard.methods.removal._settings import GroupingSettings as GroupingSettings
from graycard.methods.removal._settings import OneReferenceSettings as OneReferenceSettings
from graycard.methods.removal._settings import PerViewSettings as PerViewSettings
from graycard.methods.removal._settings import RemovalSettings as RemovalSettings
from graycard.methods.removal._stages import checked_for_removal as checked_for_removal
from graycard.methods.removal._target import check_some as check_some
from graycard.methods.removal._target import widened as widened
from graycard.methods.removal._target import with_hull as with_hull
