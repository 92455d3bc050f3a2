# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Stanford-ORB: blender_HDR/SCENE with ground_truth/SCENE beside it (Kuang et al. 2023).

Conventions (the data set's README, "Dataset Structure", and its ``orb/utils/env_map.py``):

- cameras as in NeRF's Blender layout; masks in test_mask/, train_mask/;
- ground_truth/SCENE/mesh_blender/mesh.obj is in the frame of these cameras;
- ground_truth/SCENE/env_map/NAME.exr is the light of the test photograph of that name, in the axes of its
  camera (x right, y up, z backward): up is the top row, and the image's middle looks along -z. That is our
  ``mitsuba`` turned by half a turn about y.

Only test photographs have a probe. That the light keeps still between them and the training photographs is
said nowhere, so these need a light of the user's. The scale of the LDR images against the probes is not
said either: blender_LDR is refused.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from swatchwork.capture import EnvironmentSource
from swatchwork.errors import InputError
from swatchwork.prepare.importing import nerf_blender
from swatchwork.prepare.importing.found import Found, Layout, Request, mask_for

USUAL = "test"
SPLITS = ("test", "train")
CAMERA_FROM_PROBE = np.diag([-1.0, 1.0, -1.0])
"""Half a turn about y: our ``mitsuba`` has +z in the middle of the image."""


def matches(source: Path) -> bool:
    """Whether a folder has a split's cameras and masks as this data set names them."""
    return source.is_dir() and any(
        (source / f"transforms_{s}.json").is_file() and (source / f"{s}_mask").is_dir() for s in SPLITS
    )


def read(request: Request) -> Found:
    """The photographs of a split, each test photograph with its own light.

    Raises:
        InputError: an LDR scene, another split, or a file of the layout is missing.
    """
    scene = request.source.resolve()
    split = request.split or USUAL
    if split not in SPLITS:
        raise InputError(
            f"--split is {split!r}",
            expected="one of " + ", ".join(SPLITS),
            hint="Novel views are photographs of other scenes: import those scenes",
        )
    if "LDR" in scene.parent.name:
        raise InputError(
            "the scale of these LDR images against the light probes is not documented",
            file=request.source,
            expected="the same scene of blender_HDR",
        )
    truth = scene.parent.parent / "ground_truth" / scene.name
    if split == "train" and not request.lit:
        raise InputError(
            "the training photographs have no light probe of their own",
            file=request.source,
            expected="--split test, whose photographs have one each",
            hint="Or give one light for all with --environment and --convention",
        )
    found = nerf_blender.read(replace(request, split=split, masks=None))
    shots = []
    for shot in found.shots:
        if request.masks is not None:
            mask = mask_for(request.masks, shot.name)
        else:
            mask = mask_for(scene / f"{split}_mask", Path(shot.name).name)
        light = None
        if not request.lit:
            probe = truth / "env_map" / f"{shot.image.stem}.exr"
            if not probe.is_file():
                raise InputError(
                    f"there is no {probe}",
                    file=request.source,
                    expected=f"the light of {shot.name}: ground_truth/ beside blender_HDR/",
                    hint="Unpack the data set's ground truth, or give one light with --environment",
                )
            turn = shot.camera.world_from_camera[:3, :3] @ CAMERA_FROM_PROBE
            light = EnvironmentSource(probe, "mitsuba", turn)
        shots.append(replace(shot, mask=mask, environment=light))
    mesh = truth / "mesh_blender" / "mesh.obj"
    return Found(tuple(shots), mesh if mesh.is_file() else None, normals_suspect=True, beside=(truth,))


LAYOUT = Layout("stanford-orb", matches, read)
