// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// The mesh: turned about its middle, panned and zoomed like a picture. Points are "in the ball" (see pairs_desk.py).

import { Pinhole, cross, length, looking, scale, unit } from "./algebra.js";
import { meshPainter } from "./gl.js";
import { Pane } from "./pane.js";

const AWAY = 4; // of the eye, in radii
const FILLED = 0.82; // of the pane, by the whole mesh
const SOME = 4000; // vertices that stand for all
const DEGREE = Math.PI / 180;

export class MeshPane extends Pane {
  constructor(section, on) {
    super(section, on);
    this.stage.prepend((this.base = this.canvas()));
    this.pivot = [0, 0, 0]; // stays where it is while the mesh turns
    this.view = new Pinhole([0, 0, AWAY], [1, 0, 0], [0, 1, 0], [0, 0, 1], 1, 0, 0);
    this.fitted = true;
    this.some = [];
    this.base.addEventListener("webglcontextlost", (e) => e.preventDefault());
    this.base.addEventListener("webglcontextrestored", () => this.load(...this.loaded));
  }

  load(buffer, vertices, faces) {
    this.loaded = [buffer, vertices, faces];
    const step = Math.ceil(vertices / SOME);
    const position = new Float32Array(buffer, 0, vertices * 3);
    this.some = Array.from({ length: Math.ceil(vertices / step) }, (_, i) => position.subarray(3 * i * step, 3 * i * step + 3));
    try {
      this.draw = meshPainter(this.base, buffer, vertices, faces);
    } catch (error) {
      const message = document.createElement("p");
      message.className = "message";
      message.textContent = error.message;
      this.stage.append(message);
    }
    this.resized();
  }

  /** Look from a camera: its pinhole in this pane's pixels. */
  look(view) {
    this.view = view;
    this.fitted = false;
    this.moved();
  }

  toScreen(point) {
    const [x, y, depth] = this.view.project(point);
    return depth > 0 ? [x, y] : [NaN, NaN];
  }

  /** Distance of the eye: outside the ball. */
  get away() {
    return Math.max(length(this.view.eye), 1.5);
  }

  crosshair() {
    return this.middle;
  }

  resized() {
    if (this.fitted) this.fit();
    super.resized();
  }

  /** The whole mesh in the pane, from where it is looked at now. */
  fit() {
    const away = this.away;
    const f = 0.46 * Math.min(...this.size) * Math.sqrt(away * away - 1);
    this.view = looking(scale(unit(this.view.eye), away), this.view.right, f, this.middle);
    this.fill();
    this.pivot = [0, 0, 0];
    this.fitted = true;
    this.moved();
  }

  /** Zoom and pan so that the mesh fills the pane; some vertices stand for all. */
  fill() {
    const seen = this.some.map((point) => this.view.project(point));
    if (!seen.length) return;
    const low = [0, 1].map((i) => Math.min(...seen.map((at) => at[i])));
    const high = [0, 1].map((i) => Math.max(...seen.map((at) => at[i])));
    const [x, y] = this.middle;
    this.view.pan(x - (low[0] + high[0]) / 2, y - (low[1] + high[1]) / 2);
    this.view.zoom(FILLED * Math.min(...this.size.map((v, i) => v / (high[i] - low[i]))), this.middle);
  }

  zoom(factor, at) {
    const within = Math.min(1e6, Math.max(20, this.view.f * factor)) / this.view.f;
    this.view.zoom(within, at);
    this.fitted = false;
    this.moved();
  }

  turn(right, down) {
    const stays = this.view.project(this.pivot)[2] > 0.1 ? this.pivot : [0, 0, 0];
    if (right) this.view.turn(this.view.up, right, stays);
    if (down) this.view.turn(this.view.right, down, stays);
    this.moved();
  }

  roll(angle) {
    this.view.turn(this.view.back, angle, this.pivot);
    this.moved();
  }

  drag(dx, dy, pans) {
    this.fitted &&= !pans;
    if (pans) {
      this.view.pan(dx, dy);
      this.moved();
    } else this.turn(0.5 * DEGREE * dx, 0.5 * DEGREE * dy);
  }

  arrow([dx, dy], event) {
    const fine = event.altKey ? 0.1 : 1;
    // As by a drag: the mesh goes where the arrow points; panned, the crosshair does.
    if (event.shiftKey) this.drag(-10 * fine * dx, -10 * fine * dy, true);
    else this.turn(3 * fine * DEGREE * dx, 3 * fine * DEGREE * dy);
  }

  key(event) {
    const roll = { ",": -1, ".": 1 }[event.key];
    if (!roll) return super.key(event);
    event.preventDefault();
    this.setKeyed(true);
    return this.roll(3 * DEGREE * roll);
  }

  /** Turn a point that is hidden or out of sight to the front. */
  reveal(point) {
    const eye = scale(unit(point), this.away);
    this.view = looking(eye, cross(this.view.up, eye), this.view.f, this.middle);
    const [x, y] = this.view.project(point);
    this.view.pan(this.middle[0] - x, this.middle[1] - y);
    this.fitted = false;
    this.moved();
  }

  paint() {
    const [width, height] = this.size;
    if (width && height) this.draw?.(this.view, width, height);
  }
}
