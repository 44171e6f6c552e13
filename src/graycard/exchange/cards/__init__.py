# SPDX-License-Identifier: Apache-2.0
"""A dataset as others find it: a Croissant manifest for machines, a data card for people."""
