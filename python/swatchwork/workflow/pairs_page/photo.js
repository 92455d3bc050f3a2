// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// The photograph: a picture that is panned and zoomed, the outline of the mesh over it.

import { Pane } from "./pane.js";
import { drawResidual } from "./markers.js";

const SHOWN = 4; // a residual shorter on the screen would only fill its marker
const CRISP = 3; // from this zoom on pixels show as squares

export class PhotoPane extends Pane {
  constructor(section, on) {
    super(section, on);
    this.stage.prepend((this.base = this.canvas()));
    this.residuals = [];
    this.zoomed = 1; // screen pixels of a photograph's pixel
    this.left = this.top = 0; // of the photograph, in the pane
    this.width = this.height = 1;
    this.aim = undefined; // the crosshair, in the photograph's pixels
    this.opacity = 0.9;
    this.fitted = true;
  }

  /** Show a decoded picture; keep where one looks at it if asked to. */
  show(picture, keep = false) {
    const other = picture.width !== this.width || picture.height !== this.height;
    [this.picture, this.width, this.height] = [picture, picture.width, picture.height];
    if (!keep || other) {
      this.aim = undefined;
      this.fit();
    } else this.redraw();
  }

  /** An outline drawn by the server over window (left, top, right, bottom in the photograph's pixels). */
  setOutline(picture, window) {
    this.outline = picture && { picture, window };
    this.redraw();
  }

  get window() {
    const [w, h] = this.size;
    return [...this.toImage([0, 0]), ...this.toImage([w, h])];
  }

  toScreen([u, v]) {
    return [this.left + u * this.zoomed, this.top + v * this.zoomed];
  }

  toImage([x, y]) {
    return [(x - this.left) / this.zoomed, (y - this.top) / this.zoomed];
  }

  crosshair() {
    this.aim ??= this.toImage(this.middle);
    return this.toScreen(this.aim);
  }

  resized() {
    if (this.fitted) this.fit();
    super.resized();
  }

  fit() {
    const [w, h] = this.size;
    this.zoomed = Math.min(w / this.width, h / this.height) * 0.98 || 1;
    this.left = (w - this.width * this.zoomed) / 2;
    this.top = (h - this.height * this.zoomed) / 2;
    this.fitted = true;
    this.moved();
  }

  zoom(factor, [x, y]) {
    const least = 0.2 * Math.min(this.size[0] / this.width, this.size[1] / this.height);
    const zoomed = Math.min(64, Math.max(least, this.zoomed * factor));
    this.left = x + ((this.left - x) * zoomed) / this.zoomed;
    this.top = y + ((this.top - y) * zoomed) / this.zoomed;
    this.zoomed = zoomed;
    this.fitted = false;
    this.moved();
  }

  drag(dx, dy) {
    this.left += dx;
    this.top += dy;
    this.fitted = false;
    this.moved();
  }

  /** The crosshair goes by pixels of the screen: finer in the photograph the further one has zoomed in. */
  arrow([dx, dy], event) {
    const step = (event.shiftKey ? 10 : 1) / this.zoomed;
    this.crosshair();
    this.aim = [
      Math.min(this.width, Math.max(0, this.aim[0] + dx * step)),
      Math.min(this.height, Math.max(0, this.aim[1] + dy * step)),
    ];
    this.reveal(this.aim);
    this.on.aimed(this.aim);
  }

  /** Pan as far as needed for a point to be seen well inside. */
  reveal(uv) {
    const margin = 40;
    const off = this.toScreen(uv).map((v, i) => v - Math.min(this.size[i] - margin, Math.max(margin, v)));
    if (off[0] || off[1]) this.drag(-off[0], -off[1]);
    else this.redraw();
  }

  paint() {
    const c = this.cleared(this.base);
    if (!this.picture) return;
    c.imageSmoothingEnabled = this.zoomed < CRISP;
    c.imageSmoothingQuality = "high";
    c.drawImage(this.picture, this.left, this.top, this.width * this.zoomed, this.height * this.zoomed);
    if (!this.outline || this.opacity === 0) return;
    const [left, top, right, bottom] = this.outline.window;
    const [x, y] = this.toScreen([left, top]);
    c.imageSmoothingEnabled = true;
    c.globalAlpha = this.opacity;
    c.drawImage(this.outline.picture, x, y, (right - left) * this.zoomed, (bottom - top) * this.zoomed);
    c.globalAlpha = 1;
  }

  paintOver(c) {
    for (const { from, to, colour } of this.residuals) {
      const [a, b] = [this.toScreen(from), this.toScreen(to)];
      if (Math.hypot(a[0] - b[0], a[1] - b[1]) > SHOWN) drawResidual(c, a, b, colour);
    }
  }
}
