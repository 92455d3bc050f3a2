# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Structure from motion with pycolmap, lenses held fixed; and its world brought onto the mesh's.

Optional: it joins photographs that share points which no placed photograph has yet, and is a second opinion
beside `grow`. Its world has a scale of its own; `align_to_mesh` finds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from swatchwork.arrays import F64
from swatchwork.capture import Camera
from swatchwork.errors import InputError
from swatchwork.prepare.registering.view import View

SEED = 0
LEAST_VIEWS = 3
ERROR_PX = 2.0
"""Half of COLMAP's own, of matches and of points."""
GL_FROM_CV = np.diag([1.0, -1.0, -1.0, 1.0])
"""COLMAP's camera has y down and z ahead."""


@dataclass(frozen=True, eq=False)
class Structure:
    """What structure from motion found, in a world and scale of its own.

    Attributes:
        cameras: of the photographs that it could join, by name.
        points: F64[T, 3], and ``frames``, the names of the photographs that see each.
        missing: the names of the others.
    """

    cameras: dict[str, Camera]
    points: F64
    frames: tuple[tuple[str, ...], ...]
    missing: tuple[str, ...]


def structure_from_motion(views: Sequence[View], work_folder: Path, features: int = 8192) -> Structure:
    """Poses and points of photographs from each other, without the mesh.

    Args:
        views: their lenses are taken as they are.
        work_folder: made where it is missing; photographs, masks and COLMAP's database are written to it,
            in a folder ``structure`` that must not exist.
        features: at most, a photograph.

    Raises:
        InputError: pycolmap is missing, too few photographs, two of one name, a folder ``structure`` that
            exists, or photographs that share too little.
    """
    pycolmap = _pycolmap()
    if len(views) < LEAST_VIEWS:
        raise InputError(
            f"{len(views)} photographs are given", expected=f"{LEAST_VIEWS} for structure from motion"
        )
    folder = work_folder / "structure"
    if folder.exists():
        raise InputError("is there already", file=folder, hint="Remove it, or give another folder")
    images, masks = folder / "images", folder / "masks"
    for made in (images, masks):
        made.mkdir(parents=True)
    groups: dict[tuple[float, ...], list[str]] = {}
    for view in views:
        name = f"{view.name}.png"
        if (images / name).exists():
            raise InputError(f"two photographs are named {view.name}", expected="names that differ")
        cv2.imwrite(str(images / name), view.gray)
        region = np.ones(view.gray.shape, bool) if view.region is None else view.region
        cv2.imwrite(str(masks / f"{name}.png"), region.astype(np.uint8) * 255)
        lens = view.lens
        key = (
            lens.fx,
            lens.fy,
            lens.cx,
            lens.cy,
            lens.k1,
            lens.k2,
            lens.p1,
            lens.p2,
            lens.width,
            lens.height,
        )
        groups.setdefault(key, []).append(name)

    level, pycolmap.logging.minloglevel = pycolmap.logging.minloglevel, pycolmap.logging.FATAL.value
    try:
        pycolmap.set_random_seed(SEED)
        database = folder / "database.db"
        for values, names in groups.items():
            reader = pycolmap.ImageReaderOptions()
            reader.camera_model, reader.camera_params = "OPENCV", ",".join(f"{v:.17g}" for v in values[:8])
            reader.mask_path = str(masks)
            extraction = pycolmap.FeatureExtractionOptions()
            extraction.sift.max_num_features = features
            extraction.use_gpu, extraction.num_threads = False, 1
            pycolmap.extract_features(
                database,
                images,
                names,
                pycolmap.CameraMode.SINGLE,
                reader,
                extraction,
                pycolmap.Device.cpu,
            )
        matching = pycolmap.FeatureMatchingOptions()
        matching.use_gpu, matching.num_threads = False, 1
        verification = pycolmap.TwoViewGeometryOptions()
        verification.ransac.random_seed, verification.ransac.max_error = SEED, ERROR_PX
        pycolmap.match_exhaustive(
            database, matching, verification_options=verification, device=pycolmap.Device.cpu
        )
        made_models = pycolmap.incremental_mapping(database, images, folder, _mapping(pycolmap))
    except RuntimeError as error:
        raise InputError(
            f"COLMAP failed ({str(error).strip().splitlines()[-1]})",
            expected="photographs that overlap and show texture",
        ) from error
    finally:
        pycolmap.logging.minloglevel = level
    if not made_models:
        raise InputError(
            f"{len(views)} photographs share too little for structure from motion",
            expected="photographs 10 to 25 degrees apart of a surface with texture",
            hint="Place them by clicked pairs instead",
        )
    return _read(views, max(made_models.values(), key=lambda model: int(model.num_reg_images())))


def _pycolmap() -> Any:
    try:
        import pycolmap
    except ImportError as error:
        raise InputError(
            "structure from motion is made with pycolmap, which is not installed",
            expected="the package pycolmap",
            hint="pip install 'swatchwork[colmap]'",
        ) from error
    if not hasattr(pycolmap, "FeatureExtractionOptions"):
        raise InputError(
            f"pycolmap {pycolmap.__version__} is too old for structure from motion",
            expected="3.13 or newer",
            hint="pip install -U pycolmap",
        )
    return pycolmap


def _mapping(pycolmap: Any) -> Any:
    """Options that hold the lenses, and give the same answer every time."""
    options = pycolmap.IncrementalPipelineOptions()
    options.random_seed = options.mapper.random_seed = options.triangulation.random_seed = SEED
    # Threads share the work in an order of their own, and sums of floats with it.
    options.num_threads = options.mapper.num_threads = 1
    options.ba_refine_focal_length = options.ba_refine_principal_point = False
    options.ba_refine_extra_params = False
    options.mapper.abs_pose_refine_focal_length = options.mapper.abs_pose_refine_extra_params = False
    # Small captures: the default of ten would drop them.
    options.min_model_size = LEAST_VIEWS
    options.mapper.init_min_num_inliers = 50
    options.mapper.abs_pose_min_num_inliers = 20
    options.extract_colors = False
    # Lenses are known: what is farther off than this is wrong, not yet to be calibrated away.
    options.mapper.filter_max_reproj_error = options.mapper.init_max_error = ERROR_PX
    options.triangulation.merge_max_reproj_error = options.triangulation.complete_max_reproj_error = ERROR_PX
    options.mapper.abs_pose_max_error = 3 * ERROR_PX
    return options


def _read(views: Sequence[View], model: Any) -> Structure:
    by_file = {f"{view.name}.png": view for view in views}
    cameras, name_of = {}, {}
    for number, image in model.images.items():
        if not image.has_pose:
            continue
        view = by_file[str(image.name)]
        name_of[number] = view.name
        cv_from_world = np.eye(4)
        cv_from_world[:3] = image.cam_from_world().matrix()
        pose = np.asarray(np.linalg.inv(cv_from_world) @ GL_FROM_CV, dtype=np.float64)
        cameras[view.name] = replace(view.lens, world_from_camera=pose)
    points = [model.points3D[number] for number in sorted(model.points3D)]
    frames = tuple(
        tuple(sorted({name_of[e.image_id] for e in point.track.elements if e.image_id in name_of}))
        for point in points
    )
    return Structure(
        {view.name: cameras[view.name] for view in views if view.name in cameras},
        np.array([point.xyz for point in points], dtype=np.float64).reshape(-1, 3),
        frames,
        tuple(view.name for view in views if view.name not in cameras),
    )
