# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Whole pieces of work, from folder to folder."""

from ..observe import NoiseModel
from ..reconstruct import ReconstructOptions
from ..solve import SolveOptions
from ..streaming import FrameOptions
from .analysing import AnalysisSummary, analyze_views
from .checking import CheckSummary, check_capture
from .costs import CostRecorder, StageCost
from .demonstration import DemoSummary, run_demo
from .describing import describe
from .exporting import ExportSummary, export_material
from .identity import digest_of_the_package, fingerprints
from .measuring import evaluate_folders
from .planning import PlanSummary, plan_views
from .preparing_calibrate import calibrate_photographs
from .preparing_linearize import linearize_photographs
from .preparing_pairs import PairsSummary, prepare_pairs
from .preparing_probe import prepare_probe
from .preparing_register import RegisterSummary, register_photographs
from .recovery import reconstruct_folder
from .relighting import RelightSummary, given_environment, relight_folder
from .scenes import environments_of
from .summary import ReconstructSummary
from .viewing import ViewSummary, view_folder

__all__ = [
    "AnalysisSummary",
    "CheckSummary",
    "CostRecorder",
    "DemoSummary",
    "ExportSummary",
    "FrameOptions",
    "NoiseModel",
    "PairsSummary",
    "PlanSummary",
    "ReconstructOptions",
    "ReconstructSummary",
    "RegisterSummary",
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
    "export_material",
    "fingerprints",
    "given_environment",
    "linearize_photographs",
    "plan_views",
    "prepare_pairs",
    "prepare_probe",
    "reconstruct_folder",
    "register_photographs",
    "relight_folder",
    "run_demo",
    "view_folder",
]
