# SPDX-License-Identifier: Apache-2.0
"""Speed of the surfel engine beside the peak of the machine and its peers."""
