# SPDX-License-Identifier: Apache-2.0
"""The true layers of a view, rendered or derived."""
