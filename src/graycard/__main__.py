# SPDX-License-Identifier: Apache-2.0
"""``python -m graycard VERB ...`` is ``graycard VERB ...``."""

import sys

from graycard.cli import main

if __name__ == "__main__":
    sys.exit(main())
