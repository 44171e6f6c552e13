# SPDX-License-Identifier: Apache-2.0
"""Files: hashes of code, atomic writing, hashing, locks, JSON, EXR, manifests, memory and progress."""

from graycard.io._code import code_hash as code_hash
from graycard.io._code import reached_code as reached_code
from graycard.io._decode import IN_MEMORY as IN_MEMORY
from graycard.io._exr import read_layers as read_layers
from graycard.io._exr import read_rgb as read_rgb
from graycard.io._exr import write_layers as write_layers
from graycard.io._exr import write_rgb as write_rgb
from graycard.io._files import atomic_folder as atomic_folder
from graycard.io._files import atomic_path as atomic_path
from graycard.io._files import free_mib as free_mib
from graycard.io._files import output_error as output_error
from graycard.io._files import sha256 as sha256
from graycard.io._files import sha256_of_files as sha256_of_files
from graycard.io._files import writable_folder as writable_folder
from graycard.io._files import write_bytes as write_bytes
from graycard.io._json import check_version as check_version
from graycard.io._json import dumps as dumps
from graycard.io._json import from_builtins as from_builtins
from graycard.io._json import read_json as read_json
from graycard.io._json import to_builtins as to_builtins
from graycard.io._json import write_json as write_json
from graycard.io._lock import file_lock as file_lock
from graycard.io._manifest import FORMAT_VERSION as FORMAT_VERSION
from graycard.io._manifest import MANIFEST as MANIFEST
from graycard.io._manifest import Manifest as Manifest
from graycard.io._manifest import check_files as check_files
from graycard.io._manifest import damaged_files as damaged_files
from graycard.io._manifest import read_manifest as read_manifest
from graycard.io._manifest import write_manifest as write_manifest
from graycard.io._memory import blocks as blocks
from graycard.io._memory import keep_freed_memory as keep_freed_memory
from graycard.io._memory import peak_memory_mib as peak_memory_mib
from graycard.io._progress import Progress as Progress
from graycard.io._progress import silent as silent
