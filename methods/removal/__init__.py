# SPDX-License-Identifier: Apache-2.0
"""An object is taken out of pictures, as rivals of GOR-IS do it: colours alone, no light and no material."""

from graycard.methods.removal._grouping import GroupingMethod as GroupingMethod
from graycard.methods.removal._method import KeepMethod as KeepMethod
from graycard.methods.removal._method import OneReferenceMethod as OneReferenceMethod
from graycard.methods.removal._method import PerViewMethod as PerViewMethod
from graycard.methods.removal._method import RemovalMethod as RemovalMethod
from graycard.methods.removal._scene import RemovalScene as RemovalScene
from graycard.methods.removal._settings import GroupingSettings as GroupingSettings
from graycard.methods.removal._settings import OneReferenceSettings as OneReferenceSettings
from graycard.methods.removal._settings import PerViewSettings as PerViewSettings
from graycard.methods.removal._settings import RemovalSettings as RemovalSettings
