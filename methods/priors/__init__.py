# SPDX-License-Identifier: Apache-2.0
"""Priors: answers of a pretrained network, from the truth, from classical algorithms, from weights."""

from graycard.methods.priors._build import UnloadedNetwork as UnloadedNetwork
from graycard.methods.priors._build import check_priors as check_priors
from graycard.methods.priors._build import make_priors as make_priors
from graycard.methods.priors._build import truth_of as truth_of
from graycard.methods.priors._build import unanswered as unanswered
from graycard.methods.priors._build import weights_in as weights_in
from graycard.methods.priors._build import weights_of as weights_of
from graycard.methods.priors._spec import WORST as WORST
from graycard.methods.priors._spec import KindSpec as KindSpec
from graycard.methods.priors._spec import Override as Override
from graycard.methods.priors._spec import PriorSpec as PriorSpec
from graycard.methods.priors._spec import of_kind as of_kind
from graycard.methods.priors._spec import parse_priors as parse_priors
from graycard.methods.priors._spec import told_exactly as told_exactly
