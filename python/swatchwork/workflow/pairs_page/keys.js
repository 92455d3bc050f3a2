// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// Keys that work wherever one is on the page; those of a pane are in pane.js.

const $ = (id) => document.getElementById(id);

export function bindKeys({ pairs, photo, mesh, save, fromCamera }) {
  const stations = () => [photo.stage, mesh.stage, document.querySelector("#list .selected button, #list:not(:has(.selected)) button")].filter(Boolean);

  function nextStation(back) {
    const all = stations();
    const here = all.findIndex((s) => s === document.activeElement || s.closest("aside")?.contains(document.activeElement));
    all.at((here + (back ? -1 : 1)) % all.length).focus({ focusVisible: true });
  }

  function showOther(by) {
    const names = Object.keys(pairs.of);
    pairs.show(names.at((names.indexOf(pairs.photograph) + by) % names.length));
  }

  // In the list keys are about the row that has the focus.
  const number = () => Number(document.activeElement.closest("li[data-number]")?.dataset.number ?? pairs.selected);

  const plain = {
    "?": () => $("help").showModal(),
    "[": () => pairs.step(-1),
    "]": () => pairs.step(1),
    m: () => pairs.find(number()) && pairs.select(number(), true),
    c: fromCamera,
    Delete: () => pairs.remove(number()),
    Backspace: () => pairs.remove(number()),
    Escape: () => (pairs.moving ? pairs.select(pairs.selected) : pairs.select(undefined)),
    PageUp: () => showOther(-1),
    PageDown: () => showOther(1),
  };
  const held = { s: save, z: () => pairs.undo(), y: () => pairs.redo(), Z: () => pairs.redo() };

  addEventListener("keydown", (event) => {
    if ($("help").open) return;
    if (event.key === "F6") nextStation(event.shiftKey);
    else {
      const table = event.ctrlKey || event.metaKey ? held : plain;
      const does = event.altKey ? undefined : table[event.key];
      if (!does) return;
      // A slider has its own use for paging and for deleting.
      if (event.target.type === "range" && event.key.startsWith("Page")) return;
      does();
    }
    event.preventDefault();
  });
}
