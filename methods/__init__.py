# SPDX-License-Identifier: Apache-2.0
"""Methods that take photographs apart, behind one contract; nothing here is imported to list them."""

from graycard.methods._blame import blame as blame
from graycard.methods._blame import words_of as words_of
from graycard.methods._contract import COMPOSITION as COMPOSITION
from graycard.methods._contract import LIGHTS as LIGHTS
from graycard.methods._contract import RELIGHTING as RELIGHTING
from graycard.methods._contract import Asking as Asking
from graycard.methods._contract import Composable as Composable
from graycard.methods._contract import Counting as Counting
from graycard.methods._contract import Decomposition as Decomposition
from graycard.methods._contract import Guest as Guest
from graycard.methods._contract import Method as Method
from graycard.methods._contract import NoSettings as NoSettings
from graycard.methods._contract import Relightable as Relightable
from graycard.methods._contract import Removable as Removable
from graycard.methods._contract import Surrounded as Surrounded
from graycard.methods._contract import asks_of as asks_of
from graycard.methods._predict import Changes as Changes
from graycard.methods._predict import write_predictions as write_predictions
from graycard.methods._priors import Ask as Ask
from graycard.methods._priors import Composed as Composed
from graycard.methods._priors import PriorKind as PriorKind
from graycard.methods._priors import PriorModel as PriorModel
from graycard.methods._priors import Priors as Priors
from graycard.methods._priors import PriorSource as PriorSource
from graycard.methods._priors import Question as Question
from graycard.methods._priors import Relit as Relit
from graycard.methods._registry import BUILT_IN as BUILT_IN
from graycard.methods._registry import Listing as Listing
from graycard.methods._registry import fingerprint as fingerprint
from graycard.methods._registry import listings as listings
from graycard.methods._registry import load_method as load_method
from graycard.methods._registry import offers as offers
from graycard.methods._registry import settings_of as settings_of
