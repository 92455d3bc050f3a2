// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// Texels of the page as images of the atlas, each pixel of the gutter as a texel near it.

import { arrayOf } from "./data.js";

export class Atlas {
  static async read(head) {
    const { size, n, texels } = head.atlas, on = await arrayOf(head, "on");
    const pixel = new Uint32Array(texels);
    for (let k = 0, t = 0; k < size * size; k++) if ((on[k >> 3] >> (k & 7)) & 1) pixel[t++] = k;
    const names = [...Array(n).keys()];
    const index = await Promise.all(names.map((i) => arrayOf(head, `index.${i}`)));
    const weight = await Promise.all(names.slice(0, -1).map((i) => arrayOf(head, `weight.${i}`)));
    const rest = new Uint16Array(texels).fill(65535);
    for (const one of weight) for (let t = 0; t < texels; t++) rest[t] = Math.max(0, rest[t] - one[t]);
    const atlas = new Atlas();
    Object.assign(atlas, { size, n, texels, pixel, index, weight: [...weight, rest] });
    atlas.texelAt = atlas.#filled();
    return atlas;
  }

  /** The texel at each pixel; in the gutter one that is near, ring by ring around the charts. */
  #filled() {
    const { size, pixel } = this, at = new Int32Array(size * size).fill(-1), queue = new Uint32Array(size * size);
    pixel.forEach((k, t) => (at[k] = t));
    queue.set(pixel);
    let last = pixel.length;
    const take = (from, to) => {
      if (at[to] >= 0) return;
      at[to] = at[from];
      queue[last++] = to;
    };
    for (let first = 0; first < last; first++) {
      const k = queue[first], column = k % size;
      if (column > 0) take(k, k - 1);
      if (column < size - 1) take(k, k + 1);
      if (k >= size) take(k, k - size);
      if (k < size * (size - 1)) take(k, k + size);
    }
    return at;
  }

  /** n layers of index << 16 | weight. */
  blend() {
    const { size, texelAt, n } = this, found = new Uint32Array(n * size * size);
    for (let i = 0; i < n; i++) {
      const index = this.index[i], weight = this.weight[i], start = i * size * size;
      for (let k = 0; k < size * size; k++) found[start + k] = (index[texelAt[k]] << 16) | weight[texelAt[k]];
    }
    return found;
  }

  /** Values of texels as an image. */
  spread(values, Type) {
    const found = new Type(this.texelAt.length);
    for (let k = 0; k < found.length; k++) found[k] = values[this.texelAt[k]];
    return found;
  }

  /** The texel at [u, v]. */
  texel([u, v]) {
    const clamp = (x) => Math.min(this.size - 1, Math.max(0, Math.floor(x * this.size)));
    return this.texelAt[clamp(1 - v) * this.size + clamp(u)];
  }
}
