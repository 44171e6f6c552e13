# SPDX-License-Identifier: Apache-2.0
"""Look at fitted surfels and their layers: a web viewer, and a turn around them as a film."""

from graycard.methods.viewer._film import check_film as check_film
from graycard.methods.viewer._film import write_film as write_film
from graycard.methods.viewer._orbit import orbit as orbit
from graycard.methods.viewer._orbit import up_of as up_of
from graycard.methods.viewer._preview import brightest as brightest
from graycard.methods.viewer._preview import preview as preview
from graycard.methods.viewer._saved import Fitted as Fitted
from graycard.methods.viewer._saved import is_saved as is_saved
from graycard.methods.viewer._saved import open_fitted as open_fitted
from graycard.methods.viewer._saved import saved_surfels as saved_surfels
from graycard.methods.viewer._serve import SURFELS as SURFELS
from graycard.methods.viewer._serve import serve_fitted as serve_fitted
from graycard.methods.viewer._serve import serve_pictures as serve_pictures
