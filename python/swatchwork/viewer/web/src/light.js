// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// An environment as a cube map whose levels are area means. Faces, and rows from the top of each, are in
// WebGL's order; directions are in the environment's own axes (python/swatchwork/light/conventions.py).

export const CONVENTIONS = ["blender", "mitsuba", "debevec-angular"];

const PI = Math.PI;

/** Image point `uv` of a direction, which need not be of unit length. */
export function uvFromDirection(convention, x, y, z, uv) {
  if (convention === "debevec-angular") {
    const across = Math.sqrt(x * x + y * y), radius = Math.atan2(across, -z) / PI;
    const scale = across > 0 ? radius / across : 0;
    uv[0] = (1 + x * scale) / 2;
    uv[1] = (1 - y * scale) / 2;
  } else if (convention === "blender") {
    uv[0] = 0.5 - Math.atan2(y, x) / (2 * PI);
    uv[1] = Math.atan2(Math.sqrt(x * x + y * y), z) / PI;
  } else {
    const u = Math.atan2(x, -z) / (2 * PI);
    uv[0] = u < 0 ? u + 1 : u;
    uv[1] = Math.atan2(Math.sqrt(x * x + z * z), y) / PI;
  }
}

/** Halves a raster {radiance, width, height} until it is at most `largest` wide; rows weigh by their solid angle. */
export function atMost(raster, largest, convention) {
  let { radiance, width, height } = raster;
  while (width > largest && width % 2 === 0 && height % 2 === 0) {
    const w = width / 2, h = height / 2, found = new Float32Array(w * h * 3);
    for (let j = 0; j < h; j++) {
      let a = 0.5;
      if (convention !== "debevec-angular") {
        const s = (row) => Math.sin((PI * (row + 0.5)) / height);
        a = s(2 * j) / (s(2 * j) + s(2 * j + 1));
      }
      for (let i = 0; i < w; i++)
        for (let c = 0; c < 3; c++) {
          const at = (2 * j * width + 2 * i) * 3 + c, below = at + width * 3;
          found[(j * w + i) * 3 + c] =
            0.5 * (a * (radiance[at] + radiance[at + 3]) + (1 - a) * (radiance[below] + radiance[below + 3]));
        }
    }
    [radiance, width, height] = [found, w, h];
  }
  return { radiance, width, height };
}

/** Direction of a point (s, t) in [-1, 1]^2 of a face, not of unit length. */
function onFace(face, s, t, d) {
  switch (face) {
    case 0: d[0] = 1; d[1] = -t; d[2] = -s; break;
    case 1: d[0] = -1; d[1] = -t; d[2] = s; break;
    case 2: d[0] = s; d[1] = 1; d[2] = t; break;
    case 3: d[0] = s; d[1] = -1; d[2] = -t; break;
    case 4: d[0] = s; d[1] = -t; d[2] = 1; break;
    default: d[0] = -s; d[1] = -t; d[2] = -1;
  }
}

const solidAngle = (s, t) => (1 + s * s + t * t) ** -1.5;

/** The raster with a pixel more on each side: beyond a pole the map goes on at the other side of it. */
function bordered({ radiance, width, height }, wraps) {
  const stride = width + 2, found = new Float32Array(stride * (height + 2) * 3), half = width >> 1;
  for (let j = -1; j <= height; j++)
    for (let i = -1; i <= width; i++) {
      const beyond = j < 0 || j >= height, row = Math.min(Math.max(j, 0), height - 1);
      const column = wraps ? (i + (beyond ? half : 0) + width) % width : Math.min(Math.max(i, 0), width - 1);
      const from = (row * width + column) * 3, to = ((j + 1) * stride + i + 1) * 3;
      for (let c = 0; c < 3; c++) found[to + c] = radiance[from + c];
    }
  return found;
}

/** Levels of a cube map, [level][face] as RGBA, from the base down to one texel, and the mean radiance. */
export function cubeOf(raster, convention) {
  const { width, height } = raster, pixels = bordered(raster, convention !== "debevec-angular"), stride = (width + 2) * 3;
  // A texel at a face's middle is then no larger than a pixel.
  const power = 2 ** Math.ceil(Math.log2(width));
  const size = Math.min(512, Math.max(32, width <= 256 ? power : power / 2));
  const d = [0, 0, 0], samples = 2, uv = [0, 0];
  let faces = [];
  for (let face = 0; face < 6; face++) {
    const texels = new Float32Array(size * size * 4);
    for (let j = 0; j < size; j++)
      for (let i = 0; i < size; i++) {
        let r = 0, g = 0, blue = 0;
        for (let k = 0; k < samples * samples; k++) {
          const a = k % samples, b = (k - a) / samples;
          onFace(face, (2 * (i + (a + 0.5) / samples)) / size - 1, (2 * (j + (b + 0.5) / samples)) / size - 1, d);
          uvFromDirection(convention, d[0], d[1], d[2], uv);
          const x = uv[0] * width + 0.5, y = uv[1] * height + 0.5;
          const column = Math.min(Math.floor(x), width), row = Math.min(Math.floor(y), height), fx = x - column, fy = y - row;
          const p = row * stride + column * 3, q = p + stride;
          const w00 = (1 - fx) * (1 - fy), w10 = fx * (1 - fy), w01 = (1 - fx) * fy, w11 = fx * fy;
          r += w00 * pixels[p] + w10 * pixels[p + 3] + w01 * pixels[q] + w11 * pixels[q + 3];
          g += w00 * pixels[p + 1] + w10 * pixels[p + 4] + w01 * pixels[q + 1] + w11 * pixels[q + 4];
          blue += w00 * pixels[p + 2] + w10 * pixels[p + 5] + w01 * pixels[q + 2] + w11 * pixels[q + 5];
        }
        const at = (j * size + i) * 4, scale = 1 / (samples * samples);
        texels[at] = r * scale;
        texels[at + 1] = g * scale;
        texels[at + 2] = blue * scale;
        texels[at + 3] = solidAngle((2 * i + 1) / size - 1, (2 * j + 1) / size - 1);
      }
    faces.push(texels);
  }
  const levels = [faces];
  for (let side = size; side > 1; side /= 2) {
    faces = faces.map((texels) => halved(texels, side));
    levels.push(faces);
  }
  let weight = 0;
  const mean = [0, 0, 0];
  for (const [r, g, b, w] of faces) {
    weight += w;
    [r, g, b].forEach((v, c) => (mean[c] += v * w));
  }
  return { size, levels, mean: mean.map((v) => v / weight) };
}

/** Means of 2 x 2 texels, weighed by their solid angle, which alpha holds. */
function halved(texels, side) {
  const half = side / 2, found = new Float32Array(half * half * 4);
  for (let j = 0; j < half; j++)
    for (let i = 0; i < half; i++) {
      const at = (2 * j * side + 2 * i) * 4, to = (j * half + i) * 4;
      for (const k of [at, at + 4, at + 4 * side, at + 4 * side + 4]) {
        for (let c = 0; c < 3; c++) found[to + c] += texels[k + c] * texels[k + 3];
        found[to + 3] += texels[k + 3];
      }
      for (let c = 0; c < 3; c++) found[to + c] /= found[to + 3];
    }
  return found;
}

/** Mean radiance over channels and the sphere, what exposures are measured against. */
export const brightness = (mean) => (mean[0] + mean[1] + mean[2]) / 3;
