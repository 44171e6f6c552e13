# SPDX-License-Identifier: Apache-2.0
"""Networks that scores and losses look through, and their weights: fetched, checked, kept and found."""

from graycard.networks._fetch import fetch_weights as fetch_weights
from graycard.networks._inception import has_inception as has_inception
from graycard.networks._inception import inception_features as inception_features
from graycard.networks._inception import inception_weights as inception_weights
from graycard.networks._lpips import LPIPS_VARIABLE as LPIPS_VARIABLE
from graycard.networks._lpips import Net as Net
from graycard.networks._lpips import has_lpips as has_lpips
from graycard.networks._lpips import least_side as least_side
from graycard.networks._lpips import load_lpips as load_lpips
from graycard.networks._lpips import lpips_folder as lpips_folder
from graycard.networks._lpips import lpips_layers as lpips_layers
from graycard.networks._lpips import lpips_weights as lpips_weights
from graycard.networks._lpips import published_lpips as published_lpips
from graycard.networks._sources import SETS as SETS
from graycard.networks._sources import WeightFile as WeightFile
from graycard.networks._sources import WeightSet as WeightSet
from graycard.networks._sources import find_set as find_set
from graycard.networks._store import HOME as HOME
from graycard.networks._store import WeightsState as WeightsState
from graycard.networks._store import is_whole as is_whole
from graycard.networks._store import state_of as state_of
from graycard.networks._store import weights_home as weights_home
from graycard.networks._store import weights_path as weights_path
