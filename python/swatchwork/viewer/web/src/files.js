// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// Light probes from files that a person drops on the page or opens.

import { FloatType } from "three";
import { EXRLoader } from "three/examples/jsm/loaders/EXRLoader.js";
import { HDRLoader } from "three/examples/jsm/loaders/HDRLoader.js";

/** {radiance [H, W, 3], width, height}, rows from the top; an error in words where the file is no HDR image. */
export async function readProbe(file) {
  const suffix = file.name.split(".").pop().toLowerCase();
  if (suffix !== "hdr" && suffix !== "exr") throw new Error(`${file.name} is not a light probe: drop an .hdr or .exr file`);
  const loader = suffix === "exr" ? new EXRLoader() : new HDRLoader();
  loader.setDataType(FloatType);
  let found;
  try {
    found = loader.parse(await file.arrayBuffer());
  } catch (error) {
    throw new Error(`${file.name} cannot be read: ${error.message ?? error}`);
  }
  const { data, width, height } = found, radiance = new Float32Array(width * height * 3);
  const channels = data.length / (width * height);
  for (let j = 0; j < height; j++) {
    // EXRLoader hands rows out from the bottom.
    const from = (suffix === "exr" ? height - 1 - j : j) * width * channels;
    for (let i = 0; i < width; i++)
      for (let c = 0; c < 3; c++) {
        const value = data[from + i * channels + Math.min(c, channels - 1)];
        radiance[(j * width + i) * 3 + c] = Number.isFinite(value) ? Math.max(0, value) : 0;
      }
  }
  if (width !== 2 * height && width !== height)
    throw new Error(`${file.name} is ${width} x ${height}: expected twice as wide as high, or a square angular map`);
  if (!radiance.some((v) => v > 0)) throw new Error(`${file.name} is all black`);
  return { radiance, width, height };
}
