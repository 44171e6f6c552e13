# SPDX-License-Identifier: Apache-2.0
"""Captures and photographs in the formats of other programs."""

from graycard.exchange._photographs import write_png as write_png
from graycard.exchange._transfer import ExchangeFormat as ExchangeFormat
from graycard.exchange._transfer import export_capture as export_capture
from graycard.exchange._transfer import import_capture as import_capture
