// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// Cameras: what a photograph's intrinsics, or an orbit about the object, put on the canvas.

import { Matrix3, Matrix4, Quaternion, Vector3 } from "three";

/** Row-major rows as a matrix of three.js. */
export const matrix4 = (rows) => new Matrix4().set(...rows.flat());
export const matrix3 = (rows) => new Matrix3().set(...rows.flat());

/** A photograph's camera on a canvas, as large as fits: {fx, fy, cx, cy, frame [x, y, w, h]} in canvas pixels. */
export function fitted(camera, width, height) {
  const s = Math.min(width / camera.width, height / camera.height);
  const x = (width - s * camera.width) / 2, y = (height - s * camera.height) / 2;
  return {
    fx: s * camera.fx, fy: s * camera.fy, cx: s * camera.cx + x, cy: s * camera.cy + y,
    frame: [x, y, s * camera.width, s * camera.height],
  };
}

/** What the renderer needs of a pinhole: clip matrix, eye, intrinsics, for a canvas of so many pixels. */
export function viewOf(pose, lens, width, height, centre, radius) {
  const eye = new Vector3().setFromMatrixPosition(pose);
  const distance = eye.distanceTo(centre);
  const near = Math.max(distance - 1.05 * radius, 0.005 * radius), far = distance + 1.05 * radius;
  const projection = new Matrix4().set(
    (2 * lens.fx) / width, 0, 1 - (2 * lens.cx) / width, 0,
    0, (2 * lens.fy) / height, (2 * lens.cy) / height - 1, 0,
    0, 0, -(far + near) / (far - near), (-2 * far * near) / (far - near),
    0, 0, -1, 0);
  const clip = projection.multiply(pose.clone().invert());
  return {
    clip: new Float32Array(clip.elements), eye: eye.toArray(), width, height,
    intrinsics: [lens.fx, lens.fy, lens.cx, lens.cy],
    worldFromView: new Float32Array(new Matrix3().setFromMatrix4(pose).elements),
  };
}

/** The orbit's lens: a field of view of 30 degrees across the shorter side. */
export function orbitLens(width, height) {
  const f = (0.5 * Math.min(height, width)) / Math.tan((15 * Math.PI) / 180);
  return { fx: f, fy: f, cx: width / 2, cy: height / 2 };
}

/** light_from_world as a column-major mat3: the light's own rotation, turned by an angle about the up axis. */
export function lightFromWorld(turn, up, angle) {
  const spin = new Matrix4().makeRotationFromQuaternion(new Quaternion().setFromAxisAngle(up, angle));
  const world = new Matrix3().setFromMatrix4(spin).multiply(matrix3(turn));
  return new Float32Array(world.transpose().elements);
}
