# SPDX-License-Identifier: Apache-2.0
"""Methods that take photographs apart, behind one contract."""
