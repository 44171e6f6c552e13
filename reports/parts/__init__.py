# SPDX-License-Identifier: Apache-2.0
"""Parts of a page that are drawn when they are opened, and what of a published page is kept."""
