# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""The paper's experiments (section 7.1), one short file each, from one command to one page."""

from __future__ import annotations

from .experiment import Claim, Experiment, Setting, Table
from .run import EXPERIMENTS, Reproduction, experiments_of, reproduce

__all__ = [
    "EXPERIMENTS",
    "Claim",
    "Experiment",
    "Reproduction",
    "Setting",
    "Table",
    "experiments_of",
    "reproduce",
]
