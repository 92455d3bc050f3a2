# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Swatchwork: spatially-varying reflectance from few photographs under known natural light."""
