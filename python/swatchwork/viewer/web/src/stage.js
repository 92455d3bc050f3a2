// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// What is shown, and when it is drawn. While something moves, one pass over few rings at a resolution that the
// graphics card keeps up with; once all is still, all passes over all rings, in bands short enough that the page
// answers at once.

import { Vector3 } from "three";
import { Target } from "./gl.js";
import { ROUNDS, STILL } from "./model.js";
import { lightFromWorld, orbitLens, viewOf } from "./view.js";

const FINE = 32, COARSEST = 8;
/** Of a finished picture; maps need no lookups, only antialiasing. */
const PASSES = ROUNDS * STILL.passes, MAP_PASSES = 16;
/** Pixels of the very first picture: what the graphics card can do is not known yet. */
const FIRST_PX = 6000;
/** Milliseconds that a band, and a picture while moving, should take. */
const BAND_MS = 14, MOVING_MS = 30;
/** Passes before their sum replaces the picture drawn while moving; where that is coarse, the first one does. */
const ENOUGH = 4, COARSE = 0.7;

export class Stage {
  constructor(renderer, head) {
    this.renderer = renderer;
    this.centre = new Vector3(...head.centre);
    this.radius = head.radius;
    this.up = new Vector3(...head.up);
    Object.assign(this, {
      object: null, light: null, turn: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], angle: 0, ev: 0, map: null,
      backdrop: false, ground: [0.09, 0.09, 0.1], photograph: null, split: 0.5, camera: null, paused: false,
    });
    this.moving = { scale: 0.12, cells: COARSEST };
    this.rows = { pass: 24, diffuse: 64 };
    this.stale = { picture: true, cells: true };
    this.stats = { firstPicture: null, passes: 0, total: 1, movingMs: 0 };
    this.ondrawn = () => {};
    requestAnimationFrame(() => this.#frame());
  }

  /** Something changed: `light` where the light on the object did, `shown` where only its presentation did. */
  change(what = "view") {
    if (what === "light") this.stale.cells = true;
    if (what !== "shown") this.stale.picture = true;
    this.stale.shown = true;
  }

  get lightFromWorld() {
    return lightFromWorld(this.turn, this.up, this.angle);
  }

  get enough() {
    return this.shownScale < COARSE ? 1 : ENOUGH;
  }

  get exposure() {
    return 2 ** this.ev;
  }

  /** The camera on the canvas as it is. */
  view(width = this.renderer.canvas.width, height = this.renderer.canvas.height) {
    const { pose, lens } = this.camera(width, height);
    return viewOf(pose, lens ?? orbitLens(width, height), width, height, this.centre, this.radius);
  }

  /** So many passes at once, for scripts: linear radiance [height, width, 4], premultiplied. */
  still(view, passes = STILL.passes) {
    const { renderer } = this, { width, height } = view;
    if (this.fine !== this.object || this.stale.cells || this.coarse) this.#cells(FINE, this.object.full);
    [this.coarse, this.stale.cells, this.fine] = [false, false, this.object];
    const pass = this.#target(width, height, true);
    let sum = this.#target(width, height), other = this.#target(width, height);
    this.#clear(sum);
    const table = renderer.tables.still;
    for (let j = 0; j < passes; j++) {
      renderer.pass(pass, this.object, view, this.#lit(table, j));
      renderer.add(other, sum, pass);
      [sum, other] = [other, sum];
    }
    const found = renderer.read(sum);
    for (let k = 0; k < found.length; k++) found[k] *= (k % 4 < 3 ? this.light.mean : 1) / passes;
    [pass, sum, other].forEach((target) => target.free());
    this.change();
    return found;
  }

  #lit(table, j) {
    return { table, j, light: this.light, lightFromWorld: this.lightFromWorld };
  }

  #target(width, height, depth = false) {
    return new Target(this.renderer.gl, this.renderer.formats.sum, width, height, { depth, filter: this.filter });
  }

  get filter() {
    const { gl } = this.renderer;
    return gl.getExtension("OES_texture_float_linear") ? gl.LINEAR : gl.NEAREST;
  }

  #clear(target) {
    const { gl } = this.renderer;
    target.bind();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /** The light on the sky's cells, and all of a diffuse cache from them. */
  #cells(side, cache) {
    this.renderer.prepareCells(this.light, this.lightFromWorld, side);
    if (!cache) return;
    this.renderer.diffuse(this.object, cache, side, 0, cache.height);
    this.object.cache = cache;
  }

  #frame() {
    requestAnimationFrame(() => this.#frame());
    if (this.paused || !this.object || !this.light || !this.camera || !this.#ready()) return;
    this.#resize();
    if (this.stale.picture) this.#move();
    else if (!this.#refine() && this.stale.shown) this.#show();
  }

  /** Whether the card is done with what it was given last; what it took is noted. */
  #ready() {
    const { gl } = this.renderer;
    if (!this.fence) return true;
    const status = gl.clientWaitSync(this.fence.sync, 0, 0);
    if (status === gl.TIMEOUT_EXPIRED) return false;
    gl.deleteSync(this.fence.sync);
    const { done, start } = this.fence;
    this.fence = null;
    done(performance.now() - start);
    return true;
  }

  #after(done) {
    const { gl } = this.renderer;
    this.fence = { sync: gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0), start: this.started, done };
    gl.flush();
  }

  #resize() {
    const { canvas } = this.renderer, scale = Math.min(window.devicePixelRatio || 1, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * scale)), height = Math.max(1, Math.round(canvas.clientHeight * scale));
    if (this.pass && canvas.width === width && canvas.height === height) return;
    [canvas.width, canvas.height] = [width, height];
    [this.pass, this.sum, this.other, this.quick].forEach((target) => target?.free());
    this.pass = this.#target(width, height, true);
    this.sum = this.#target(width, height);
    this.other = this.#target(width, height);
    this.quick = null;
    this.stale.picture = true;
  }

  /** A picture while something moves. */
  #move() {
    const { renderer, moving } = this, { canvas } = renderer;
    this.started = performance.now();
    if (this.stats.firstPicture === null) moving.scale = Math.min(moving.scale, Math.sqrt(FIRST_PX / (canvas.width * canvas.height)));
    const width = Math.max(1, Math.round(canvas.width * moving.scale)), height = Math.max(1, Math.round(canvas.height * moving.scale));
    if (this.quick?.width !== width || this.quick?.height !== height) {
      this.quick?.free();
      this.quick = this.#target(width, height, true);
    }
    const relit = this.stale.cells && !this.map;
    if (relit) this.#cells(moving.cells, this.object.quick);
    if (this.map) renderer.map(this.quick, this.object, this.view(width, height), this.map, null);
    else renderer.pass(this.quick, this.object, this.view(width, height), this.#lit(renderer.tables.moving, 0));
    if (relit) [this.coarse, this.stale.cells, this.fine] = [true, false, null];
    this.stale.picture = false;
    Object.assign(this, { done: 0, row: 0, diffuseRow: 0, shownScale: moving.scale });
    this.stillSince = performance.now();
    this.#show();
    this.#after((ms) => {
      this.stats.firstPicture ??= performance.now();
      this.stats.movingMs = ms;
      const wanted = moving.scale * Math.sqrt(MOVING_MS / Math.max(ms, 1));
      // A screen's frame is the least that can be told: below it, go up slowly.
      moving.scale = Math.min(1, Math.max(0.12, ms < 20 ? moving.scale * 1.3 : 0.5 * (moving.scale + wanted)));
      if (relit) moving.cells = ms < 40 ? Math.min(16, moving.cells * 2) : COARSEST;
    });
  }

  /** The next band of the still picture; false where it is finished. */
  #refine() {
    const { renderer } = this, table = renderer.tables.still;
    this.stats.total = this.map ? MAP_PASSES : PASSES;
    if (this.done === this.stats.total) return false;
    if (performance.now() - this.stillSince < 90) return Boolean(this.stale.shown && (this.#show(), true));
    this.started = performance.now();
    if (this.coarse && !this.map) {
      const { height } = this.object.full, last = Math.min(height, this.diffuseRow + this.rows.diffuse);
      if (this.diffuseRow === 0) this.#cells(FINE, null);
      renderer.diffuse(this.object, this.object.full, FINE, this.diffuseRow, last);
      this.diffuseRow = last;
      if (last === height) {
        this.object.cache = this.object.full;
        [this.coarse, this.diffuseRow, this.fine] = [false, 0, this.object];
      }
      this.#after((ms) => (this.rows.diffuse = next(this.rows.diffuse, ms, height)));
      return true;
    }
    if (this.done === 0 && this.row === 0) this.#clear(this.sum);
    const { height } = this.pass, last = Math.min(height, this.row + this.rows.pass), view = this.view();
    if (this.map) renderer.map(this.pass, this.object, view, this.map, this.done, this.row, last);
    else renderer.pass(this.pass, this.object, view, this.#lit(table, this.done), this.row, last);
    this.row = last;
    if (last === height) {
      renderer.add(this.other, this.sum, this.pass);
      [this.sum, this.other] = [this.other, this.sum];
      [this.row, this.done] = [0, this.done + 1];
      if (this.done >= this.enough) this.#show();
    } else if (this.stale.shown) this.#show();
    this.stats.passes = this.done;
    this.#after((ms) => (this.rows.pass = next(this.rows.pass, ms, height)));
    return true;
  }

  #show() {
    const { renderer, photograph } = this, still = this.done >= this.enough, view = this.view();
    const frame = photograph ? this.camera(view.width, view.height).lens?.frame : null;
    renderer.show(still ? this.sum : this.quick, {
      uScale: still ? 1 / this.done : 1, uExposure: this.exposure, uCoded: Boolean(this.map), uBackdrop: this.backdrop,
      uGround: this.ground, uWorldFromView: view.worldFromView, uIntrinsics: view.intrinsics,
      ...(frame && { uPhotograph: photograph.texture, uFrame: frame, uSplit: this.split, uWhite: photograph.white / this.light.mean,
        uPhotographExposure: this.exposure }),
    }, this.light, this.lightFromWorld);
    this.stale.shown = false;
    this.stats.passes = this.done;
    this.ondrawn();
  }
}

/** How many rows to take next, where the last so many took so long. */
function next(rows, ms, height) {
  const wanted = ms < 18 ? rows * 1.5 : (rows * BAND_MS) / ms;
  return Math.max(4, Math.min(height, Math.round(Math.max(rows / 3, wanted))));
}
