// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

/** A sphere that stands where the object does, with UVs, for one representative at a time. */
export function sphere(centre, radius, up, rows = 96) {
  const columns = 2 * rows, count = (rows + 1) * (columns + 1);
  const position = new Float32Array(3 * count), normal = new Float32Array(3 * count), uv = new Float32Array(2 * count);
  const axis = up.findIndex((v) => v !== 0), a = (axis + 1) % 3, b = (axis + 2) % 3;
  const faces = [];
  for (let j = 0, k = 0; j <= rows; j++)
    for (let i = 0; i <= columns; i++, k++) {
      const theta = (Math.PI * j) / rows, phi = (2 * Math.PI * i) / columns;
      const d = [0, 0, 0];
      d[axis] = Math.cos(theta) * up[axis];
      d[a] = Math.sin(theta) * Math.cos(phi);
      d[b] = Math.sin(theta) * Math.sin(phi);
      for (let c = 0; c < 3; c++) {
        normal[3 * k + c] = d[c];
        position[3 * k + c] = centre[c] + radius * d[c];
      }
      uv[2 * k] = i / columns;
      uv[2 * k + 1] = 1 - j / rows;
      if (j < rows && i < columns) faces.push(k, k + columns + 1, k + 1, k + 1, k + columns + 1, k + columns + 2);
    }
  return { position, normal, uv, faces: new Uint32Array(faces) };
}

/** One representative everywhere on an atlas of so many pixels a side. */
export const alone = (index, size) => new Uint32Array(size * size).fill((index << 16) | 65535);
