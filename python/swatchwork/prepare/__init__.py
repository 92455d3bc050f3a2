# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Prepare: from what a camera wrote to a capture (paper, section 6)."""
