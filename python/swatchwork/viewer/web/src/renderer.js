// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// Passes on the graphics card. A picture is a mean of passes: each walks its part of the rings from a camera moved by
// a part of a pixel, with texels moved by a part of a texel, so that all together are antialiased and interpolated.

import { Program, Target, cube, layers, texture2D } from "./gl.js";
import { MOVING, STILL, diffusePairs, diffuseTable, ringTable } from "./model.js";
import { brightness } from "./light.js";
import * as shaders from "./shaders.js";

const ONE = [0, 0, 1, 1];
/** Texels along a side of the diffuse caches: while the light moves, and at most. */
const QUICK = 256, LARGEST = 2048;

export class Renderer {
  constructor(canvas, material, colours, slots) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
    if (!gl) throw new Error("this browser has no WebGL 2");
    const float = gl.getExtension("EXT_color_buffer_float");
    if (!float && !gl.getExtension("EXT_color_buffer_half_float"))
      throw new Error("this graphics card cannot draw into floating-point textures");
    gl.getExtension("OES_texture_float_linear");
    Object.assign(this, { gl, canvas, material });
    this.formats = {
      half: [gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT],
      sum: float ? [gl.RGBA32F, gl.RGBA, gl.FLOAT] : [gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT],
      table: [gl.RGBA32F, gl.RGBA, gl.FLOAT],
    };
    const { SURFACE, FLAT, EVERYWHERE } = shaders;
    this.programs = {
      depth: new Program(gl, SURFACE, shaders.NOTHING),
      shaded: new Program(gl, SURFACE, shaders.shaded(material, slots)),
      mapped: new Program(gl, SURFACE, shaders.MAPPED),
      where: new Program(gl, SURFACE, shaders.WHERE),
      diffuse: new Program(gl, FLAT, shaders.diffuse(diffusePairs(material))),
      cells: new Program(gl, EVERYWHERE, shaders.CELLS),
      added: new Program(gl, EVERYWHERE, shaders.ADDED),
      shown: new Program(gl, EVERYWHERE, shaders.SHOWN),
    };
    this.everywhere = gl.createVertexArray();
    this.tables = Object.fromEntries(
      Object.entries({ moving: MOVING, still: STILL }).map(([name, plan]) => [name, this.#table(plan)]));
    this.diffuseTable = texture2D(gl, this.formats.table, diffusePairs(material).length, material.N, diffuseTable(material));
    this.colours = texture2D(gl, this.formats.table, material.N, colours.length / (4 * material.N), colours);
    this.cells = {};
    this.pick = new Target(gl, this.formats.sum, 1, 1, { depth: true });
    this.blank = texture2D(gl, [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE], 1, 1, new Uint8Array(4));
  }

  #table(plan) {
    const { gl, formats, material } = this, found = ringTable(material, plan);
    const rows = found.weight.length / (4 * found.width);
    return {
      ...found,
      ring: texture2D(gl, formats.table, found.width, 1, found.ring),
      weight: texture2D(gl, formats.table, found.width, rows, found.weight),
    };
  }

  /** A mesh with the blends and masks of its texels; `sky` and `skyRow` may be missing. */
  object({ position, normal, uv, faces, size, blend, skyRow, sky }) {
    const { gl } = this, vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    [[position, 3], [normal, 3], [uv, 2]].forEach(([values, count], place) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, count, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    const words = [gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT], shadowed = Boolean(sky && sky.length);
    const rows = shadowed ? Math.ceil(sky.length / (64 * 128)) : 1;
    const padded = new Uint32Array(rows * 64 * 128);
    if (shadowed) padded.set(sky);
    const full = this.#cache(Math.min(size, LARGEST)), quick = size > QUICK ? this.#cache(QUICK) : full;
    return {
      vao, count: faces.length, size, shadowed,
      blend: layers(gl, size, size, blend),
      slots: blend.length / (size * size),
      skyRow: texture2D(gl, [gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT], shadowed ? size : 1, shadowed ? size : 1,
        shadowed ? skyRow : new Uint32Array(1)),
      sky: texture2D(gl, words, 64 * 32, rows, padded),
      full, quick, cache: quick,
    };
  }

  #cache(side) {
    return new Target(this.gl, this.formats.half, side, side, { count: 4 });
  }

  /** Other blends for an object's texels. */
  reblend(object, blend) {
    this.gl.deleteTexture(object.blend.texture);
    object.blend = layers(this.gl, object.size, object.size, blend);
    object.slots = blend.length / object.size ** 2;
  }

  /** A light ready to be looked up. */
  light(found) {
    let brightest = 1e-30;
    for (const face of found.levels[0]) for (let k = 0; k < face.length; k++) if (k % 4 < 3 && face[k] > brightest) brightest = face[k];
    const unit = 2 ** (Math.ceil(Math.log2(brightest)) - 15), mean = Math.max(brightness(found.mean), 1e-30);
    return { cube: cube(this.gl, found, unit), face: found.size, unit: unit / mean, mean };
  }

  #lit(light, lightFromWorld, sharpen = 0.5) {
    return { uLight: light.cube, uLightFromWorld: lightFromWorld, uUnit: light.unit, uFace: light.face, uSharpen: sharpen };
  }

  #blended(object) {
    return { uBlend: object.blend, uSlots: object.slots, uSkyRow: object.skyRow, uSky: object.sky, uShadowed: object.shadowed };
  }

  /** The light of side x side cells of the sky, for `diffuse`. */
  prepareCells(light, lightFromWorld, side) {
    const { gl } = this;
    this.cells[side] ??= new Target(gl, this.formats.sum, side, side, { count: 2 });
    this.cells[side].bind();
    this.#plain();
    this.programs.cells.use({ ...this.#lit(light, lightFromWorld), uSide: side });
    this.#cover();
  }

  /** Rows [first, last) of one of an object's diffuse caches. */
  diffuse(object, cache, side, first, last) {
    const { gl } = this, [power, towards] = this.cells[side].textures;
    cache.bind();
    this.#plain();
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, first, cache.width, last - first);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.programs.diffuse.use({
      ...this.#blended(object), uPower: power, uTowards: towards, uDiffuse: this.diffuseTable, uSide: side, uTexels: cache.height,
    });
    this.#draw(object);
    gl.disable(gl.SCISSOR_TEST);
  }

  /** Rows [first, last) of pass j of a table into a target. */
  pass(target, object, view, { table, j, light, lightFromWorld }, first = 0, last = target.height) {
    const { jitter, dither } = table.passes > 1 ? offsets(j) : { jitter: [0, 0], dither: [0, 0] };
    const [c0, c1, c2, c3] = object.cache.textures;
    this.#surface(target, object, view, jitter, first, last, this.programs.shaded, {
      ...this.#blended(object), ...this.#lit(light, lightFromWorld, table.sharpen),
      uEye: view.eye, uDither: dither, uRing: table.ring, uWeight: table.weight, uFirst: (j % table.passes) * table.rings, uRings: table.rings,
      uCache0: c0, uCache1: c1, uCache2: c2, uCache3: c3,
    });
  }

  /** As `pass`, of a map; j is null for the middles of pixels. */
  map(target, object, view, { kind, chosen, values }, j, first = 0, last = target.height) {
    const jitter = j === null ? [0, 0] : offsets(j).jitter;
    this.#surface(target, object, view, jitter, first, last, this.programs.mapped, {
      ...this.#blended(object), uEye: view.eye, uKind: kind, uChosen: chosen, uColours: this.colours, uValues: values ?? this.blank,
    });
  }

  #surface(target, object, view, jitter, first, last, program, values) {
    const { gl } = this, clip = moved(view.clip, jitter, target);
    target.bind();
    this.#plain();
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, first, target.width, last - first);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    // Depth first, so that each pixel is shaded once.
    gl.colorMask(false, false, false, false);
    gl.depthFunc(gl.LESS);
    this.programs.depth.use({ uClip: clip, uPick: ONE });
    this.#draw(object);
    gl.colorMask(true, true, true, true);
    gl.depthFunc(gl.EQUAL);
    program.use({ uClip: clip, uPick: ONE, ...values });
    this.#draw(object);
    gl.depthFunc(gl.LESS);
    this.#plain();
    gl.disable(gl.SCISSOR_TEST);
  }

  /** to = sum + pass. */
  add(to, sum, pass) {
    to.bind();
    this.#plain();
    this.programs.added.use({ uSum: sum.texture, uPass: pass.texture });
    this.#cover();
  }

  /** The atlas coordinates [u, v] at a pixel of a view, row 0 at the top; null off the object. */
  uvAt(object, view, column, row) {
    const { gl } = this, { width, height } = view, found = new Float32Array(4);
    this.pick.bind();
    this.#plain();
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    const pick = [(2 * (column + 0.5)) / width - 1, 1 - (2 * (row + 0.5)) / height, width, height];
    this.programs.where.use({ uClip: view.clip, uPick: pick });
    this.#draw(object);
    this.#plain();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.FLOAT, found);
    return found[2] > 0 ? [found[0], found[1]] : null;
  }

  /** A picture onto the canvas. */
  show(picture, values, light, lightFromWorld) {
    const { gl, canvas } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    this.#plain();
    this.programs.shown.use({
      ...this.#lit(light, lightFromWorld), uPicture: picture.texture, uPixels: [canvas.width, canvas.height], uPhotograph: this.blank,
      uFrame: [0, 0, 1, 1], uSplit: -1, uWhite: 1, uPhotographExposure: 1, ...values,
    });
    this.#cover();
  }

  /** Numbers of a target [height, width, 4], row 0 at the top. */
  read(target) {
    const { gl } = this, { width, height } = target, found = new Float32Array(width * height * 4), row = width * 4;
    target.bind();
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, found);
    const turned = new Float32Array(found.length);
    for (let j = 0; j < height; j++) turned.set(found.subarray((height - 1 - j) * row, (height - j) * row), j * row);
    return turned;
  }

  #plain() {
    this.gl.disable(this.gl.DEPTH_TEST);
    this.gl.disable(this.gl.BLEND);
  }

  #draw(object) {
    this.gl.bindVertexArray(object.vao);
    this.gl.drawElements(this.gl.TRIANGLES, object.count, this.gl.UNSIGNED_INT, 0);
  }

  #cover() {
    this.gl.bindVertexArray(this.everywhere);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }
}

/**
 * By what parts, in [-0.5, 0.5]^2, pass j is moved: `jitter` of a pixel, each sixteen passes over a 4 x 4 grid and all
 * 64 over an 8 x 8 grid; `dither` of a texel, a 4 x 4 grid in another order.
 */
function offsets(j) {
  const place = (m, along) => [((m % along) + 0.5) / along - 0.5, (Math.floor(m / along) + 0.5) / along - 0.5];
  const [x, y] = place(ORDER[j & 15], 4), [dx, dy] = place([0, 3, 1, 2][(j >> 4) & 3], 2);
  return { jitter: [x + dx / 4, y + dy / 4], dither: place((j * 11 + 6) & 15, 4) };
}

/** Places of a 4 x 4 grid; every fourth is in the same quarter. */
const ORDER = [1, 14, 7, 8, 4, 11, 2, 13, 0, 15, 3, 12, 5, 10, 6, 9];

/** A clip matrix whose picture is moved by a part of a pixel. */
function moved(clip, [dx, dy], { width, height }) {
  const found = new Float32Array(clip);
  for (let c = 0; c < 4; c++) {
    found[4 * c] += ((2 * dx) / width) * clip[4 * c + 3];
    found[4 * c + 1] += ((2 * dy) / height) * clip[4 * c + 3];
  }
  return found;
}
