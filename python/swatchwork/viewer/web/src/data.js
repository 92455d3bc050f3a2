// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// The page's blocks of data: text elements with base64 of deflated arrays, as viewer/packing.py writes them.

const TYPES = {
  uint8: Uint8Array, int8: Int8Array, uint16: Uint16Array, int16: Int16Array,
  uint32: Uint32Array, int32: Int32Array, float32: Float32Array,
};

/** The page's head: everything but the arrays. */
export function readHead() {
  return JSON.parse(document.getElementById("head").textContent);
}

/** Bytes of a block as they stand on the page. */
export function fileOf(name) {
  const text = atob(document.getElementById(`block:${name}`).textContent);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = text.charCodeAt(k);
  return bytes;
}

/** A block as a typed array, with what was done to make it deflate well undone. */
export async function arrayOf(head, name) {
  const { type, shape, coding } = head.blocks[name];
  const Type = TYPES[type];
  const count = shape.reduce((a, b) => a * b, 1);
  const planes = await inflated(fileOf(name), count * Type.BYTES_PER_ELEMENT);
  const size = Type.BYTES_PER_ELEMENT;
  const bytes = size === 1 ? planes : new Uint8Array(planes.length);
  for (let b = 0; size > 1 && b < size; b++) {
    const from = b * count;
    for (let k = 0, to = b; k < count; k++, to += size) bytes[to] = planes[from + k];
  }
  const values = new Type(bytes.buffer);
  const row = count / Math.max(shape[0], 1);
  if (coding === "delta") for (let k = row; k < count; k++) values[k] += values[k - row];
  return values;
}

async function inflated(bytes, size) {
  if (!size) return new Uint8Array(0);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  const found = new Uint8Array(await new Response(stream).arrayBuffer());
  if (found.length !== size) throw new Error(`a block has ${found.length} bytes, not ${size}`);
  return found;
}

/** Half-precision numbers as single-precision ones. */
export function singles(halves, unit = 1) {
  const table = new Float32Array(65536);
  for (let k = 0; k < 65536; k++) {
    const exponent = (k >> 10) & 31, mantissa = k & 1023;
    const size = exponent ? 2 ** (exponent - 25) * (1024 + mantissa) : 2 ** -24 * mantissa;
    table[k] = (k & 0x8000 ? -size : size) * unit;
  }
  const found = new Float32Array(halves.length);
  for (let k = 0; k < found.length; k++) found[k] = table[halves[k]];
  return found;
}
