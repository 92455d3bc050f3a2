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
from .preparing_calibrate import calibrate_photographs
from .preparing_linearize import linearize_photographs
from .preparing_probe import prepare_probe
from .recovery import ReconstructSummary, digest_of_the_package, fingerprints, reconstruct_folder
from .relighting import RelightSummary, given_environment, relight_folder
from .scenes import environments_of
from .viewing import ViewSummary, view_folder

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
    "ViewSummary",
    "analyze_views",
    "calibrate_photographs",
    "check_capture",
    "describe",
    "digest_of_the_package",
    "environments_of",
    "evaluate_folders",
    "fingerprints",
    "given_environment",
    "linearize_photographs",
    "plan_views",
    "prepare_probe",
    "reconstruct_folder",
    "relight_folder",
    "run_demo",
    "view_folder",
]
