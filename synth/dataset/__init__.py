# SPDX-License-Identifier: Apache-2.0
"""From a spec to a scene folder: renderings, photographs, sparse points, manifests."""
