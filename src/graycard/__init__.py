# SPDX-License-Identifier: Apache-2.0
"""graycard: inverse rendering, judged by scenes whose light, albedo and normals are known exactly.

This package door holds the shared vocabulary. The stages are packages of their own, none of which is
imported here: :mod:`graycard.synth`, :mod:`graycard.methods`, :mod:`graycard.eval`,
:mod:`graycard.benchmarks`, :mod:`graycard.reports`.
"""

from graycard._camera import Camera as Camera
from graycard._camera import look_at as look_at
from graycard._colour import display_variance as display_variance
from graycard._colour import srgb_decode as srgb_decode
from graycard._colour import srgb_encode as srgb_encode
from graycard._colour import srgb_slope as srgb_slope
from graycard._dataset import TRACKS as TRACKS
from graycard._dataset import Capture as Capture
from graycard._dataset import SceneObject as SceneObject
from graycard._dataset import Truth as Truth
from graycard._dataset import View as View
from graycard._dataset import capture_folders as capture_folders
from graycard._dataset import manifest_of as manifest_of
from graycard._dataset import open_capture as open_capture
from graycard._dataset import open_truth as open_truth
from graycard._dataset import read_lights as read_lights
from graycard._dataset import scene_folders as scene_folders
from graycard._dataset import write_index as write_index
from graycard._dataset import write_lights as write_lights
from graycard._errors import DatasetError as DatasetError
from graycard._errors import GraycardError as GraycardError
from graycard._errors import MethodError as MethodError
from graycard._errors import NewerFormatError as NewerFormatError
from graycard._errors import OutputError as OutputError
from graycard._errors import PredictionError as PredictionError
from graycard._errors import RecordError as RecordError
from graycard._errors import RenderError as RenderError
from graycard._errors import UnknownNameError as UnknownNameError
from graycard._exr import read_layers as read_layers
from graycard._exr import read_rgb as read_rgb
from graycard._exr import write_layers as write_layers
from graycard._exr import write_rgb as write_rgb
from graycard._files import atomic_folder as atomic_folder
from graycard._files import atomic_path as atomic_path
from graycard._files import free_mib as free_mib
from graycard._files import sha256 as sha256
from graycard._files import sha256_of_files as sha256_of_files
from graycard._files import sources_hash as sources_hash
from graycard._files import writable_folder as writable_folder
from graycard._files import write_bytes as write_bytes
from graycard._json import check_version as check_version
from graycard._json import decode as decode
from graycard._json import dumps as dumps
from graycard._json import encode as encode
from graycard._json import read_json as read_json
from graycard._json import write_json as write_json
from graycard._layers import Layer as Layer
from graycard._layers import find_fault as find_fault
from graycard._layers import layer as layer
from graycard._layers import layers as layers
from graycard._layers import shape_of as shape_of
from graycard._lights import EnvironmentLight as EnvironmentLight
from graycard._lights import GaussianLight as GaussianLight
from graycard._lights import Light as Light
from graycard._lights import LocalLight as LocalLight
from graycard._lights import PointLight as PointLight
from graycard._lights import RectangleLight as RectangleLight
from graycard._lights import SphereLight as SphereLight
from graycard._lights import SphericalGaussian as SphericalGaussian
from graycard._lights import SpotLight as SpotLight
from graycard._lights import light_from_json as light_from_json
from graycard._lights import light_to_json as light_to_json
from graycard._lights import world_position as world_position
from graycard._lock import alone as alone
from graycard._manifest import FORMAT_VERSION as FORMAT_VERSION
from graycard._manifest import Manifest as Manifest
from graycard._manifest import check_files as check_files
from graycard._manifest import damaged_files as damaged_files
from graycard._manifest import read_manifest as read_manifest
from graycard._manifest import seal as seal
from graycard._photographs import write_png as write_png
from graycard._points import Points as Points
from graycard._points import read_points as read_points
from graycard._points import write_points as write_points
from graycard._predictions import Predictions as Predictions
from graycard._predictions import clear_predictions as clear_predictions
from graycard._predictions import finish_predictions as finish_predictions
from graycard._predictions import open_predictions as open_predictions
from graycard._predictions import predictions_hash as predictions_hash
from graycard._predictions import write_view as write_view
from graycard._progress import Progress as Progress
from graycard._progress import silent as silent
from graycard._records import Cost as Cost
from graycard._records import Job as Job
from graycard._records import JobResult as JobResult
from graycard._records import MethodRecord as MethodRecord
from graycard._records import MetricRecord as MetricRecord
from graycard._records import RunRecord as RunRecord
from graycard._records import SceneRecord as SceneRecord
from graycard._records import Score as Score
from graycard._records import ScoreSheet as ScoreSheet
from graycard._records import Status as Status
from graycard._records import read_run as read_run
from graycard._records import read_score_sheet as read_score_sheet
from graycard._sensor import Sensor as Sensor
from graycard._transfer import ExchangeFormat as ExchangeFormat
from graycard._transfer import export_capture as export_capture
from graycard._transfer import import_capture as import_capture

__version__ = "0.1.0"
