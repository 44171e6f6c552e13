# SPDX-License-Identifier: Apache-2.0
"""Compile kernels before they are needed: the jobs, and the processes that do them."""
