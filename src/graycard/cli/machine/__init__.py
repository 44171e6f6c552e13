# SPDX-License-Identifier: Apache-2.0
"""The verbs for this machine: look at it and mend it, fetch weights, complete words in the shell."""
