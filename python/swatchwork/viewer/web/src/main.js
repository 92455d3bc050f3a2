// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// The page: reads its blocks, makes the object and the lights, and hands them to the stage and the panel.

import { Atlas } from "./atlas.js";
import { arrayOf, fileOf, readHead, singles } from "./data.js";
import { atMost, cubeOf } from "./light.js";
import { ROUNDS } from "./model.js";
import { Renderer } from "./renderer.js";
import { alone, sphere } from "./sphere.js";
import { Stage } from "./stage.js";
import { Orbit } from "./orbit.js";
import { Panel, rgb } from "./panel.js";
import { fitted, matrix4, viewOf } from "./view.js";

const SPHERE_TEXELS = 128;
/** Widest dropped light; wider ones are halved. */
const LIGHT_PX = 1024;
/** The kind of map that has a number for each texel of the object. */
const OF_TEXELS = 3;

class Viewer {
  constructor(head) {
    this.head = head;
    this.canvas = document.getElementById("stage");
    this.lights = head.lights.map((about) => ({ ...about, held: null }));
    const { material } = head;
    this.renderer = new Renderer(this.canvas, material, colourTable(material), head.atlas.n);
    this.stage = new Stage(this.renderer, head);
    this.orbit = new Orbit(this.canvas, head, () => this.moved());
    this.stage.camera = (width, height) =>
      this.shot ? { pose: matrix4(this.shot.camera.pose), lens: fitted(this.shot.camera, width, height) } : { pose: this.orbit.pose() };
    Object.assign(this, { shot: null, photographs: new Map(), values: new Map(), chosen: 0, onSphere: false });
  }

  async load() {
    const { head, renderer } = this;
    await this.setLight(0);
    const [position, normal, uv, faces, rows, sky] = await Promise.all(
      ["position", "normal", "uv", "faces", "sky_row", "sky"].map((name) => arrayOf(head, name)));
    this.atlas = await Atlas.read(head);
    const { low, size } = head.mesh;
    const mesh = {
      position: Float32Array.from(position, (v, k) => low[k % 3] + (v / 65535) * size[k % 3]),
      normal: Float32Array.from(normal, (v) => v / 32767),
      uv: Float32Array.from(uv, (v) => v / 65535),
      faces: new Uint32Array(faces.buffer),
    };
    this.scanned = renderer.object({
      ...mesh, size: this.atlas.size, blend: this.atlas.blend(), skyRow: this.atlas.spread(rows, Uint32Array),
      sky: sky.length ? new Uint32Array(sky.buffer) : null,
    });
    this.ball = renderer.object({
      ...sphere(head.centre, 0.8 * head.radius, head.up), size: SPHERE_TEXELS, blend: alone(0, SPHERE_TEXELS),
    });
    this.stage.object = this.scanned;
    this.stage.change("light");
  }

  /** The lookups that a pixel makes, moving and still. */
  get lookups() {
    const { moving, still } = this.renderer.tables;
    return { moving: moving.lookups, still: ROUNDS * still.lookups, passes: ROUNDS * still.passes };
  }

  /** Put the object under one of the lights; those of the page are unpacked when first asked for. */
  async setLight(number, turn = null) {
    const about = this.lights[number];
    if (!about.held) {
      about.raster ??= {
        radiance: singles(await arrayOf(this.head, about.block), about.unit), width: about.width, height: about.height,
      };
      about.held = this.renderer.light(cubeOf(atMost(about.raster, LIGHT_PX, about.convention), about.convention));
    }
    this.light = number;
    this.stage.light = about.held;
    this.stage.turn = turn ?? about.turn;
    this.stage.change("light");
  }

  /** A light from elsewhere; its convention may be changed afterwards. */
  async addLight(name, raster, convention) {
    this.lights.push({ name, raster, convention, turn: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], held: null, dropped: true });
    await this.setLight(this.lights.length - 1);
  }

  async setConvention(convention) {
    const about = this.lights[this.light], before = about.held;
    Object.assign(about, { convention, held: null });
    await this.setLight(this.light);
    this.renderer.gl.deleteTexture(before.cube.texture);
  }

  rotate(angle) {
    this.stage.angle = angle;
    this.stage.change("light");
  }

  expose(ev) {
    this.stage.ev = ev;
    this.stage.change("shown");
  }

  /** Look through a photograph's camera, under its light, beside it; null goes back to the orbit. */
  async compare(number) {
    const shot = number === null ? null : this.head.shots[number];
    if (!shot) {
      this.shot = this.stage.photograph = null;
      this.stage.change();
      return;
    }
    if (!this.photographs.has(number)) {
      const file = new Blob([fileOf(shot.block)], { type: "image/webp" });
      const picture = await createImageBitmap(file, { premultiplyAlpha: "none" });
      this.photographs.set(number, { texture: this.#photograph(picture), white: shot.white });
    }
    // Whoever orbits away, or closes the photograph, goes on from its place.
    this.shot = null;
    this.orbit.from(matrix4(shot.camera.pose));
    this.shot = shot;
    this.stage.photograph = this.photographs.get(number);
    this.stage.angle = 0;
    this.sphere(null);
    await this.setLight(shot.light, shot.turn);
  }

  #photograph(picture) {
    const { gl } = this.renderer, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) gl.texParameteri(gl.TEXTURE_2D, name, value);
    return { target: gl.TEXTURE_2D, texture };
  }

  /** One representative on a sphere, lit where the map was of the object's texels; or the object itself (null). */
  sphere(index) {
    this.onSphere = index !== null;
    if (this.onSphere) {
      this.chosen = index;
      this.renderer.reblend(this.ball, alone(index, SPHERE_TEXELS));
      if (this.stage.map?.kind === OF_TEXELS) this.stage.map = null;
    }
    this.stage.object = this.onSphere ? this.ball : this.scanned;
    this.stage.change("light");
  }

  /** Show a map: {kind, number}; null shows the material lit. */
  async map(found) {
    let map = null;
    if (found) {
      map = { kind: found.kind, chosen: this.chosen, values: null };
      if (found.kind === OF_TEXELS) {
        map.values = (await this.valuesOf(found.number)).texture;
        if (this.onSphere) this.sphere(null);
      }
    }
    this.stage.map = map;
    // Under a light that changed meanwhile the cache is out of date.
    this.stage.change(map ? "view" : "light");
  }

  async valuesOf(number) {
    if (!this.values.has(number)) {
      const { gl } = this.renderer, size = this.atlas.size;
      const texels = await arrayOf(this.head, this.head.maps[number].block), texture = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, size, size, 0, gl.RED, gl.UNSIGNED_BYTE, this.atlas.spread(texels, Uint8Array));
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
      this.values.set(number, { texels, texture: { target: gl.TEXTURE_2D, texture } });
    }
    return this.values.get(number);
  }

  /** What is known of the surface at a pixel of the page: blend and the maps that were shown; null off it. */
  at(x, y) {
    if (!this.atlas || this.onSphere) return null;
    const { width, height, clientWidth, clientHeight } = this.canvas;
    const uv = this.renderer.uvAt(this.stage.object, this.stage.view(), (x / clientWidth) * width, (y / clientHeight) * height);
    if (!uv) return null;
    const texel = this.atlas.texel(uv);
    const blend = this.atlas.index.map((index, i) => [index[texel], this.atlas.weight[i][texel] / 65535]).filter(([, w]) => w > 5e-4);
    const values = this.head.maps.map((map, m) => {
      const code = this.values.get(m)?.texels[texel];
      return code === undefined ? undefined : { name: map.name, unit: map.unit, value: code ? ((code - 1) / 254) * map.top : null, most: code === 255 };
    });
    return { uv, blend: blend.sort((a, b) => b[1] - a[1]), values: values.filter(Boolean) };
  }

  moved() {
    if (this.shot) this.panel?.leavePhotograph();
    this.stage.change();
  }

  /** For scripts: the still picture of a camera {width, height, fx, fy, cx, cy, pose}, as linear radiance. */
  still(camera, passes) {
    const { width, height } = camera, lens = { fx: camera.fx, fy: camera.fy, cx: camera.cx, cy: camera.cy };
    return this.stage.still(viewOf(matrix4(camera.pose), lens, width, height, this.stage.centre, this.stage.radius), passes);
  }
}

/** [3, N, 4]: the representatives' colours, diffuse and specular albedos. */
function colourTable(material) {
  const found = new Float32Array(3 * material.N * 4);
  for (let n = 0; n < material.N; n++) {
    found.set(rgb(material.colours[n % material.colours.length]), n * 4);
    found.set(material.albedo.diffuse[n], (material.N + n) * 4);
    found.set(material.albedo.specular[n], (2 * material.N + n) * 4);
  }
  return found;
}

async function begin() {
  const status = document.getElementById("status");
  try {
    const viewer = new Viewer(readHead());
    window.swatchwork = viewer;
    await viewer.load();
    viewer.panel = new Panel(viewer);
    status.remove();
  } catch (error) {
    status.textContent = `This page cannot be shown here: ${error.message}`;
    console.error(error);
  }
}

window.swatchworkReady = begin();
