# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whole pieces of work, from folder to folder."""

from ..reconstruct import ReconstructOptions
from ..solve import SolveOptions
from .analysing import AnalysisSummary, analyze_views
from .checking import CheckSummary, check_capture
from .costs import CostRecorder, StageCost
from .demonstration import DemoSummary, run_demo
from .describing import describe
from .measuring import evaluate_folders
from .planning import PlanSummary, plan_views
from .recovery import ReconstructSummary, digest_of_the_package, fingerprints, reconstruct_folder
from .relighting import RelightSummary, given_environment, relight_folder
from .scenes import environments_of

__all__ = [
    "AnalysisSummary",
    "CheckSummary",
    "CostRecorder",
    "DemoSummary",
    "PlanSummary",
    "ReconstructOptions",
    "ReconstructSummary",
    "RelightSummary",
    "SolveOptions",
    "StageCost",
    "analyze_views",
    "check_capture",
    "describe",
    "digest_of_the_package",
    "environments_of",
    "evaluate_folders",
    "fingerprints",
    "given_environment",
    "plan_views",
    "reconstruct_folder",
    "relight_folder",
    "run_demo",
]
