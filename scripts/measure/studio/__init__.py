# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""A studio that is all known: an object, a mirror ball and a board before a simulated camera."""
