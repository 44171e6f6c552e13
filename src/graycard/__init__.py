# SPDX-License-Identifier: Apache-2.0
"""graycard: inverse rendering, judged by scenes whose light, albedo and normals are known exactly.

This door holds the domain: cameras, lights, layers, captures, truth, predictions and errors. The rest of
the vocabulary has doors of its own: :mod:`graycard.io` (files), :mod:`graycard.records` (scores and runs),
:mod:`graycard.exchange` (formats of other programs), :mod:`graycard.layers`, :mod:`graycard.lights`,
:mod:`graycard.colour`, :mod:`graycard.dataset`, :mod:`graycard.predictions`, :mod:`graycard.points`,
:mod:`graycard.edits` and :mod:`graycard.resources`. The stages are packages of their own, none of which is
imported here: :mod:`graycard.synth`, :mod:`graycard.methods`, :mod:`graycard.eval`,
:mod:`graycard.benchmarks`, :mod:`graycard.reports`.
"""

from graycard._angles import angles as angles
from graycard._camera import Camera as Camera
from graycard._camera import look_at as look_at
from graycard._capture import Capture as Capture
from graycard._capture import View as View
from graycard._errors import DatasetError as DatasetError
from graycard._errors import GraycardError as GraycardError
from graycard._errors import MethodError as MethodError
from graycard._errors import NewerFormatError as NewerFormatError
from graycard._errors import NewerRecordError as NewerRecordError
from graycard._errors import OlderRecordError as OlderRecordError
from graycard._errors import OutputError as OutputError
from graycard._errors import PredictionError as PredictionError
from graycard._errors import RecordError as RecordError
from graycard._errors import RenderError as RenderError
from graycard._errors import UnknownNameError as UnknownNameError
from graycard._errors import WeightsError as WeightsError
from graycard._missing import MissingPackageError as MissingPackageError
from graycard._missing import absent_packages as absent_packages
from graycard._missing import install_command as install_command
from graycard._missing import missing_package as missing_package
from graycard._sensor import Sensor as Sensor
from graycard._truth import SceneObject as SceneObject
from graycard._truth import Truth as Truth
from graycard.colour import luminance as luminance
from graycard.colour import srgb_decode as srgb_decode
from graycard.colour import srgb_encode as srgb_encode
from graycard.dataset import TRACKS as TRACKS
from graycard.dataset import capture_folders as capture_folders
from graycard.dataset import open_capture as open_capture
from graycard.dataset import open_truth as open_truth
from graycard.edits import Composition as Composition
from graycard.edits import Donor as Donor
from graycard.edits import EditKind as EditKind
from graycard.edits import LightEdit as LightEdit
from graycard.io import Progress as Progress
from graycard.layers import Layer as Layer
from graycard.layers import all_layers as all_layers
from graycard.layers import find_layer as find_layer
from graycard.lights import EnvironmentLight as EnvironmentLight
from graycard.lights import GaussianLight as GaussianLight
from graycard.lights import Light as Light
from graycard.lights import LocalLight as LocalLight
from graycard.lights import PointLight as PointLight
from graycard.lights import RectangleLight as RectangleLight
from graycard.lights import SphereLight as SphereLight
from graycard.lights import SphericalGaussian as SphericalGaussian
from graycard.lights import SpotLight as SpotLight
from graycard.lights import world_position as world_position
from graycard.points import Points as Points
from graycard.predictions import Predictions as Predictions
from graycard.predictions import open_predictions as open_predictions

__version__ = "0.1.0"
