// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// The pose of each photograph, as the server found it from the pairs.

import { ask } from "./server.js";

export class Poses {
  constructor(pairs, fewest) {
    Object.assign(this, { pairs, fewest });
    this.of = {}; // the server's answer, with the pairs' numbers and the text that it is of
  }

  /** The answer for the photograph on screen, pose or reason. */
  get answer() {
    return this.of[this.pairs.photograph];
  }

  get current() {
    return this.answer?.rms_px === undefined ? undefined : this.answer;
  }

  /** Ask again where the pairs have changed; whether they had. */
  async find(name) {
    const whole = this.pairs.complete(name);
    const text = JSON.stringify(whole);
    const before = this.of[name];
    if (whole.length < this.fewest) {
      delete this.of[name];
      return before !== undefined;
    }
    if (before?.text === text) return false;
    this.of[name] = { ...before, text };
    let found;
    try {
      found = await ask("pose", { uv_px: whole.map((p) => p.uv), x_in_mesh: whole.map((p) => p.x) });
    } catch (error) {
      if (this.of[name]?.text === text) delete this.of[name];
      throw error;
    }
    // An answer to pairs that have moved on meanwhile is late.
    if (this.of[name]?.text !== text) return false;
    this.of[name] = { ...found, text, numbers: whole.map((p) => p.number) };
    return true;
  }

  /** What the pose leaves of a pair: {px, fits, at}; undefined where it was not asked about. */
  residual(number) {
    const found = this.current;
    const i = found?.numbers?.indexOf(number) ?? -1;
    return i < 0 ? undefined : { px: found.residual_px[i], fits: found.inliers[i], at: found.projected_px[i] };
  }
}
