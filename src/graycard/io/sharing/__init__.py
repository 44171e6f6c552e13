# SPDX-License-Identifier: Apache-2.0
"""File systems that several machines share: the kernel's locks may not hold there, and files are late."""
