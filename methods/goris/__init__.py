# SPDX-License-Identifier: Apache-2.0
"""Parts of ``goris``: an object is taken out together with its mirror image (GOR-IS, CVPR 2026)."""
