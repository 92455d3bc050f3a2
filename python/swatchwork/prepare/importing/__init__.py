# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Other programs' and data sets' folders as captures: one file for each layout."""

from swatchwork.prepare.importing.bringing import LAYOUTS, ImportSummary, import_capture

__all__ = ["LAYOUTS", "ImportSummary", "import_capture"]
