# SPDX-FileCopyrightText: Swatchwork contributors
# SPDX-License-Identifier: MIT
"""Captures: photographs with cameras, a mesh, and the light they were taken under; readers and writers."""

from swatchwork.capture.camera import Camera, rigid
from swatchwork.capture.capture import CONVENTIONS, Capture, EnvironmentSource, Frame
from swatchwork.capture.exr import exr_in_bands, read_exr_channels, write_exr, write_exr_channels
from swatchwork.capture.fields import path_within, shown
from swatchwork.capture.guarding import MOST_MESH_BYTES, need_file, parsed_json, read_json
from swatchwork.capture.images import IMAGE_SUFFIXES, Image, linear_from_srgb, read_image, write_png
from swatchwork.capture.photograph import Photograph, check_radiance, read_mask, read_photograph
from swatchwork.capture.transforms import read_capture
from swatchwork.capture.writing import write_capture

__all__ = [
    "CONVENTIONS",
    "IMAGE_SUFFIXES",
    "MOST_MESH_BYTES",
    "Camera",
    "Capture",
    "EnvironmentSource",
    "Frame",
    "Image",
    "Photograph",
    "check_radiance",
    "exr_in_bands",
    "linear_from_srgb",
    "need_file",
    "parsed_json",
    "path_within",
    "read_capture",
    "read_exr_channels",
    "read_image",
    "read_json",
    "read_mask",
    "read_photograph",
    "rigid",
    "shown",
    "write_capture",
    "write_exr",
    "write_exr_channels",
    "write_png",
]
