# SPDX-License-Identifier: Apache-2.0
"""Secret scenes: their seeds follow from a salt that is kept until a run is over, and then opened"""
