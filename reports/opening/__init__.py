# SPDX-License-Identifier: Apache-2.0
"""The top of a page: who is best, in one sentence and one strip of pictures a track."""
