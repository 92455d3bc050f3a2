// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// Vectors of three numbers, and a pinhole that looks at the unit ball.

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(...a);
export const unit = (a) => scale(a, 1 / (length(a) || 1));

/** v turned about a unit axis (Rodrigues). */
export function turned(v, axis, angle) {
  const c = Math.cos(angle);
  return add(add(scale(v, c), cross(axis, v), Math.sin(angle)), axis, dot(axis, v) * (1 - c));
}

/** A pinhole: an eye with axes in the ball, a focal length f and a principal point (px, py) in the pane's pixels.
 *  Zoom and pan are those of a picture (f and the principal point), so the eye never runs into the mesh. */
export class Pinhole {
  constructor(eye, right, up, back, f, px, py) {
    Object.assign(this, { eye, right, up, back, f, px, py });
  }

  /** Where a point appears, [x, y, depth]. */
  project(point) {
    const p = add(point, this.eye, -1);
    const depth = -dot(p, this.back);
    return [this.px + (this.f * dot(p, this.right)) / depth, this.py - (this.f * dot(p, this.up)) / depth, depth];
  }

  /** Direction that looks through a pixel; its component along the axis is 1. */
  ray([x, y]) {
    const aside = add(scale(this.right, (x - this.px) / this.f), this.up, -(y - this.py) / this.f);
    return add(aside, this.back, -1);
  }

  /** Turn the object about the ball's centre, by radians; point stays where it is on the screen. */
  turn(axis, angle, point) {
    const [x, y] = this.project(point);
    for (const name of ["eye", "right", "up", "back"]) this[name] = turned(this[name], axis, -angle);
    // Rounding would add up over a long session.
    this.back = unit(this.back);
    this.right = unit(cross(this.up, this.back));
    this.up = cross(this.back, this.right);
    const [to_x, to_y] = this.project(point);
    this.pan(x - to_x, y - to_y);
  }

  pan(dx, dy) {
    this.px += dx;
    this.py += dy;
  }

  zoom(factor, [x, y]) {
    this.f *= factor;
    this.px = x + (this.px - x) * factor;
    this.py = y + (this.py - y) * factor;
  }

  /** Clip space from the ball, column by column as WebGL wants it, for a pane of w x h. */
  matrix(w, h) {
    const away = length(this.eye);
    const near = Math.max(away - 1.05, 0.01 * away);
    const far = away + 1.05;
    const rows = [this.right, this.up, this.back].map((axis) => [...axis, -dot(axis, this.eye)]);
    const depth = rows[2].map((v) => -v);
    const x = rows[0].map((v, i) => (2 * this.f * v) / w + ((2 * this.px) / w - 1) * depth[i]);
    const y = rows[1].map((v, i) => (2 * this.f * v) / h + (1 - (2 * this.py) / h) * depth[i]);
    const z = depth.map((v, i) => ((far + near) / (far - near)) * v - (i === 3 ? (2 * far * near) / (far - near) : 0));
    return new Float32Array([0, 1, 2, 3].flatMap((i) => [x[i], y[i], z[i], depth[i]]));
  }
}

/** A pinhole that looks from an eye at the ball's centre; its right is as near to the given one as can be. */
export function looking(eye, right, f, [px, py]) {
  const back = unit(eye);
  let level = add(right, back, -dot(right, back));
  if (length(level) < 1e-3) level = cross(Math.abs(back[1]) < 0.9 ? [0, 1, 0] : [0, 0, 1], back);
  level = unit(level);
  return new Pinhole(eye, level, cross(back, level), back, f, px, py);
}
