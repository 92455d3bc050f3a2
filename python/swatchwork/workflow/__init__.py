# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whole pieces of work, from folder to folder."""

from ..reconstruct import ReconstructOptions
from ..solve import SolveOptions
from .costs import CostRecorder, StageCost
from .demonstration import DemoSummary, run_demo
from .describing import describe
from .measuring import evaluate_folders
from .recovery import ReconstructSummary, digest_of_the_package, fingerprints, reconstruct_folder
from .relighting import RelightSummary, relight_folder

__all__ = [
    "CostRecorder",
    "DemoSummary",
    "ReconstructOptions",
    "ReconstructSummary",
    "RelightSummary",
    "SolveOptions",
    "StageCost",
    "describe",
    "digest_of_the_package",
    "evaluate_folders",
    "fingerprints",
    "reconstruct_folder",
    "relight_folder",
    "run_demo",
]
