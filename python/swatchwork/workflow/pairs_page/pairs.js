// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// The pairs of all photographs, which is selected, and every state they were in.
// A pair is {number, uv, x}: pixels of the photograph, coordinates of the mesh's file; one of them may be null yet.

export class Pairs extends EventTarget {
  constructor(photographs, saved) {
    super();
    const listed = (name) => (saved[name] ?? []).map((p, i) => ({ number: i + 1, uv: p.uv_px, x: p.x_in_mesh }));
    this.of = Object.fromEntries(photographs.map((name) => [name, listed(name)]));
    this.empty = JSON.stringify(Object.fromEntries(photographs.map((name) => [name, []])));
    this.photograph = photographs[0];
    this.selected = undefined;
    this.moving = false;
    this.past = [];
    this.future = [];
    this.asSaved = this.text();
  }

  get list() {
    return this.of[this.photograph];
  }

  get current() {
    return this.find(this.selected);
  }

  /** The pair that lacks a side. */
  get open() {
    return this.list.find((p) => !p.uv || !p.x);
  }

  get changed() {
    return this.text() !== this.asSaved;
  }

  find(number) {
    return this.list.find((p) => p.number === number);
  }

  complete(name = this.photograph) {
    return this.of[name].filter((p) => p.uv && p.x);
  }

  /** Put a side ("uv" or "x") of the pair being moved, of the open one, or of a new one. */
  place(side, value) {
    const moved = this.moving ? this.current : undefined;
    this.remember();
    let pair = moved ?? this.open;
    if (!pair) {
      pair = { number: Math.max(0, ...this.list.map((p) => p.number)) + 1, uv: null, x: null };
      this.list.push(pair);
    }
    pair[side] = value;
    this.moving = false;
    this.selected = pair.number;
    this.told();
  }

  /** Move a side without remembering each step; remember() comes before the first. */
  shift(number, side, value) {
    this.find(number)[side] = value;
    this.told();
  }

  remove(number = this.selected) {
    const place = this.list.findIndex((p) => p.number === number);
    if (place < 0) return;
    this.remember();
    this.list.splice(place, 1);
    this.moving = false;
    this.selected = this.list[Math.min(place, this.list.length - 1)]?.number;
    this.told();
  }

  select(number, moving = false) {
    [this.selected, this.moving] = [number, moving && number !== undefined];
    this.told();
  }

  /** The pair after (1) or before (-1) the selected one. */
  step(by) {
    if (!this.list.length) return;
    const place = this.list.findIndex((p) => p.number === this.selected);
    const next = place < 0 ? (by > 0 ? 0 : -1) : place + by;
    this.select(this.list.at(next % this.list.length).number);
  }

  show(name) {
    [this.photograph, this.selected, this.moving] = [name, undefined, false];
    this.told();
  }

  remember() {
    this.past.push(this.snapshot());
    this.future = [];
  }

  undo() {
    this.travel(this.past, this.future);
  }

  redo() {
    this.travel(this.future, this.past);
  }

  travel(from, to) {
    if (!from.length) return;
    to.push(this.snapshot());
    const { of, photograph, selected } = JSON.parse(from.pop());
    Object.assign(this, { of, photograph, selected, moving: false });
    this.told();
  }

  snapshot() {
    const { of, photograph, selected } = this;
    return JSON.stringify({ of, photograph, selected });
  }

  /** As pairs.json has them: whole pairs only. */
  written() {
    const form = (name) => this.complete(name).map((p) => ({ uv_px: p.uv, x_in_mesh: p.x }));
    return Object.fromEntries(Object.keys(this.of).map((name) => [name, form(name)]));
  }

  text() {
    return JSON.stringify(this.written());
  }

  told() {
    this.dispatchEvent(new Event("change"));
  }
}
