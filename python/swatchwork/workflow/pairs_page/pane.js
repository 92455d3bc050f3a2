// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// What photograph and mesh have in common: canvases of the pane's size, clicks and drags, the wheel, the keys.
// A pane asks its maker (on) to place, select and move points, and knows nothing of pairs but their markers.

import { REACH, drawCrosshair, drawMarker } from "./markers.js";

const STILL = 4; // px that a click may wander
const STEP = 1.25; // of a zoom by key or button
export const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Pane {
  /** on: {place(at), select(number), grab(number), drag(number, at), drop(number), changed()} */
  constructor(section, on) {
    this.section = section;
    this.stage = section.querySelector(".stage");
    this.on = on;
    this.markers = [];
    this.keyed = false; // whether the crosshair shows
    this.over = this.canvas();
    new ResizeObserver(() => this.resized()).observe(this.stage);
    this.stage.addEventListener("pointerdown", (e) => this.down(e));
    this.stage.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    this.stage.addEventListener("contextmenu", (e) => e.preventDefault());
    this.stage.addEventListener("keydown", (e) => this.key(e));
    this.stage.addEventListener("focus", () => this.setKeyed(this.stage.matches(":focus-visible")));
    this.stage.addEventListener("blur", () => this.setKeyed(false));
    for (const button of section.querySelectorAll("[data-do]"))
      button.addEventListener("click", () => this.does(button.dataset.do));
  }

  canvas() {
    const made = document.createElement("canvas");
    made.setAttribute("aria-hidden", "true");
    this.stage.append(made);
    return made;
  }

  /** Width and height, with their fractions of a pixel: canvases are stretched to it. */
  get size() {
    const { width, height } = this.stage.getBoundingClientRect();
    return [width, height];
  }

  get middle() {
    return this.size.map((v) => v / 2);
  }

  resized() {
    const [width, height] = this.size;
    for (const canvas of this.stage.querySelectorAll("canvas")) {
      canvas.width = Math.max(1, Math.round(width * devicePixelRatio));
      canvas.height = Math.max(1, Math.round(height * devicePixelRatio));
    }
    this.redraw();
  }

  setKeyed(keyed) {
    this.keyed = keyed;
    this.redraw();
  }

  redraw() {
    this.pending ??= requestAnimationFrame(() => {
      this.pending = undefined;
      this.paint();
      const c = this.cleared(this.over);
      this.paintOver(c);
      const last = (a, b) => Number(a.selected) - Number(b.selected);
      for (const marker of [...this.markers].sort(last)) drawMarker(c, { ...marker, at: this.toScreen(marker.point) });
      if (this.keyed) drawCrosshair(c, this.crosshair());
    });
  }

  cleared(canvas) {
    const c = canvas.getContext("2d");
    const [width, height] = this.size;
    c.setTransform(canvas.width / width, 0, 0, canvas.height / height, 0, 0);
    c.clearRect(0, 0, width, height);
    return c;
  }

  paintOver() {}

  /** The view was moved: draw it, and say so. */
  moved() {
    this.redraw();
    this.on.changed();
  }

  at(event) {
    const box = this.stage.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  markerAt([x, y]) {
    const near = ({ point, hidden }) => {
      const [u, v] = this.toScreen(point);
      return !hidden && Math.hypot(u - x, v - y) < REACH;
    };
    return this.markers.findLast(near)?.number;
  }

  down(event) {
    if (event.button > 2) return;
    event.preventDefault();
    this.stage.focus({ preventScroll: true, focusVisible: false });
    this.setKeyed(false);
    this.stage.setPointerCapture(event.pointerId);
    const start = this.at(event);
    const grabbed = event.button === 0 && !this.on.waits() ? this.markerAt(start) : undefined;
    let last = start;
    let dragged = false;
    const move = (e) => {
      const here = this.at(e);
      if (!dragged && Math.hypot(here[0] - start[0], here[1] - start[1]) <= STILL) return;
      if (!dragged && grabbed !== undefined) this.on.grab(grabbed);
      dragged = true;
      if (grabbed !== undefined) this.on.drag(grabbed, here);
      else this.drag(here[0] - last[0], here[1] - last[1], e.shiftKey || event.button > 0);
      last = here;
    };
    const end = (e) => {
      for (const [name, does] of [["pointermove", move], ["pointerup", end], ["pointercancel", end]])
        this.stage.removeEventListener(name, does);
      if (dragged && grabbed !== undefined) this.on.drop(grabbed);
      if (dragged || e.type === "pointercancel" || event.button !== 0) return;
      if (grabbed !== undefined) this.on.select(grabbed);
      else this.on.place(start);
    };
    for (const [name, does] of [["pointermove", move], ["pointerup", end], ["pointercancel", end]])
      this.stage.addEventListener(name, does);
  }

  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 16 : 1;
    this.zoom(Math.exp(-0.0016 * lines * Math.max(-240, Math.min(240, event.deltaY))), this.at(event));
  }

  does(what) {
    if (what === "fit") this.fit();
    else this.zoom(what === "in" ? STEP : 1 / STEP, this.keyed ? this.crosshair() : this.middle);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey) return;
    const what = { "+": "in", "=": "in", "-": "out", _: "out", 0: "fit" }[event.key];
    if (event.key in ARROWS) this.arrow(ARROWS[event.key], event);
    else if (event.key === "Enter") this.on.place(this.crosshair());
    else if (what) this.does(what);
    else return;
    event.preventDefault();
    event.stopPropagation();
    this.setKeyed(true);
  }
}
