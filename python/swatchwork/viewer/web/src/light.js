// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// An environment as a cube map whose levels are area means. Faces, and rows from the top of each, are in
// WebGL's order; directions are in the environment's own axes (python/swatchwork/light/conventions.py).

export const CONVENTIONS = ["blender", "mitsuba", "debevec-angular"];

const PI = Math.PI;

/** Image point [u, v] of a direction, which need not be of unit length. */
export function uvFromDirection(convention, x, y, z) {
  if (convention === "debevec-angular") {
    const across = Math.hypot(x, y), radius = Math.atan2(across, -z) / PI;
    const scale = across > 0 ? radius / across : 0;
    return [(1 + x * scale) / 2, (1 - y * scale) / 2];
  }
  if (convention === "blender") return [0.5 - Math.atan2(y, x) / (2 * PI), Math.atan2(Math.hypot(x, y), z) / PI];
  const u = Math.atan2(x, -z) / (2 * PI);
  return [u < 0 ? u + 1 : u, Math.atan2(Math.hypot(x, z), y) / PI];
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

/** Levels of a cube map, [level][face] as RGBA, from the base down to one texel, and the mean radiance. */
export function cubeOf(raster, convention) {
  const { radiance, width, height } = raster;
  // A texel at a face's middle is then no larger than a pixel.
  const power = 2 ** Math.ceil(Math.log2(width));
  const size = Math.min(512, Math.max(32, width <= 256 ? power : power / 2));
  const wraps = convention !== "debevec-angular", half = width >> 1;
  const fetch = (column, row, weight, sum) => {
    if (wraps) {
      // Beyond a pole the map goes on at the other side of it.
      if (row < 0 || row >= height) (row = row < 0 ? -1 - row : 2 * height - 1 - row), (column += half);
      column = ((column % width) + width) % width;
    } else {
      column = Math.min(Math.max(column, 0), width - 1);
      row = Math.min(Math.max(row, 0), height - 1);
    }
    const at = (row * width + column) * 3;
    for (let c = 0; c < 3; c++) sum[c] += weight * radiance[at + c];
  };
  const d = [0, 0, 0], sum = [0, 0, 0], samples = 2;
  let faces = [];
  for (let face = 0; face < 6; face++) {
    const texels = new Float32Array(size * size * 4);
    for (let j = 0; j < size; j++)
      for (let i = 0; i < size; i++) {
        sum[0] = sum[1] = sum[2] = 0;
        for (let b = 0; b < samples; b++)
          for (let a = 0; a < samples; a++) {
            onFace(face, (2 * (i + (a + 0.5) / samples)) / size - 1, (2 * (j + (b + 0.5) / samples)) / size - 1, d);
            const uv = uvFromDirection(convention, d[0], d[1], d[2]);
            const x = uv[0] * width - 0.5, y = uv[1] * height - 0.5;
            const column = Math.floor(x), row = Math.floor(y), fx = x - column, fy = y - row;
            fetch(column, row, (1 - fx) * (1 - fy), sum);
            fetch(column + 1, row, fx * (1 - fy), sum);
            fetch(column, row + 1, (1 - fx) * fy, sum);
            fetch(column + 1, row + 1, fx * fy, sum);
          }
        const at = (j * size + i) * 4, scale = 1 / (samples * samples);
        for (let c = 0; c < 3; c++) texels[at + c] = sum[c] * scale;
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
