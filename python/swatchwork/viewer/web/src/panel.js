// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// The side panel, keys, the photograph's slider, files dropped, and the read-out under the pointer.

import { CONVENTIONS } from "./light.js";
import { readProbe } from "./files.js";

const KEYS = [
  ["arrows", "orbit"], ["+  −", "nearer, further"], ["[  ]", "turn the light"], [",  .", "darker, brighter"],
  ["L", "next light"], ["P", "next photograph"], ["M", "next map"], ["S", "next representative on a sphere"],
  ["O", "the object again"], ["B", "light as backdrop"], ["R", "reset camera, light and exposure"],
  ["H", "hide the panel"], ["?", "these keys"],
];
const CONVENTION_WORDS = { blender: "Blender: z up", mitsuba: "Mitsuba, glTF: y up", "debevec-angular": "angular map" };

/** A colour #rrggbb as three numbers in [0, 1]. */
export const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16) / 255);

/** An element; every string among the children is text. */
function el(tag, props = {}, ...children) {
  const node = Object.assign(document.createElement(tag), props);
  node.append(...children.flat(2).filter((child) => child !== null));
  return node;
}

export class Panel {
  constructor(viewer) {
    this.viewer = viewer;
    this.root = document.getElementById("panel");
    this.maps = this.#mapList();
    this.build();
    this.#listen();
    viewer.stage.ondrawn = () => this.#status();
    this.#theme();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#theme());
  }

  #mapList() {
    const { head } = this.viewer;
    return [
      { name: "the material, lit", value: null },
      { name: "representatives, blended", value: { kind: 0 }, legend: "chips" },
      { name: "strongest representative", value: { kind: 1 }, legend: "chips" },
      { name: "weight of one representative", value: { kind: 2 }, legend: "heat", top: "100 %" },
      ...head.maps.map((map, number) => ({
        name: map.name, value: { kind: 3, number }, legend: "heat", top: number_(map.top, map.unit), none: true,
      })),
      { name: "diffuse albedo", value: { kind: 4 } },
      { name: "specular albedo", value: { kind: 5 } },
    ];
  }

  build() {
    const { head, lookups } = this.viewer, { material } = head;
    const option = (text, value) => el("option", { textContent: text, value });
    const range = (props) => el("input", { type: "range", ...props });

    this.light = el("select", { id: "light", title: "light (L)" });
    this.convention = el("select", { id: "convention", title: "what the file's pixels stand for" }, CONVENTIONS.map((c) => option(CONVENTION_WORDS[c], c)));
    this.turn = range({ id: "turn", min: -180, max: 180, step: 1, value: 0, title: "turn the light ([ and ])" });
    this.backdrop = el("input", { type: "checkbox", id: "backdrop" });
    this.file = el("input", { type: "file", id: "file", accept: ".hdr,.exr", hidden: true });
    this.ev = range({ id: "ev", min: -5, max: 5, step: 0.1, value: 0, title: "exposure (, and .)" });
    this.map = el("select", { id: "map", title: "what to show (M)" }, this.maps.map((m, k) => option(m.name, k)));
    this.legend = el("div", { className: "legend" });
    this.chips = [...Array(material.N).keys()].map((n) =>
      el("button", { className: "chip", type: "button", title: material.notes[n] ?? "" },
        el("i", { style: `background:${material.colours[n % material.colours.length]}` }), `${n + 1}`));
    this.object = el("button", { className: "chip on", type: "button", textContent: "object", id: "object" });
    this.chipNote = el("p", { className: "note" });
    this.shots = el("select", { id: "shots", title: "photograph (P)" }, option("none", ""), head.shots.map((s, k) => option(s.name, k)));
    this.readout = el("div", { className: "readout", id: "readout" });
    this.statusLine = el("p", { className: "note", id: "progress" });
    this.conventionRow = el("label", { className: "row" }, el("span", { textContent: "read as" }), this.convention);

    const row = (text, control, output = null) => el("label", { className: "row" }, el("span", { textContent: text }), control, output);
    this.turnOut = el("output");
    this.evOut = el("output");
    this.root.replaceChildren(...[
      el("header", {},
        el("div", { className: "brand" }, material.colours.slice(0, 4).map((c) => el("i", { style: `background:${c}` })), el("span", { textContent: "Swatchwork viewer" })),
        el("h1", { textContent: head.title }),
        el("p", { className: "note", textContent: `${material.N} material${material.N > 1 ? "s" : ""}, up to ${head.atlas.n} blended at a point` })),
      section("Light", row("light", this.light), this.conventionRow, row("turn", this.turn, this.turnOut), row("exposure", this.ev, this.evOut),
        el("div", { className: "row" }, el("button", { type: "button", textContent: "Open .hdr or .exr…", onclick: () => this.file.click() }), this.file,
          el("label", { className: "check" }, this.backdrop, "backdrop"))),
      section("Show", row("map", this.map), this.legend),
      section("Representatives, each on a sphere", el("div", { className: "chips" }, this.object, this.chips), this.chipNote),
      head.shots.length ? section("Beside a photograph", row("photo", this.shots), el("p", { className: "note", textContent: "Photograph left of the line, the material right of it. Drag the line." })) : null,
      section("Under the pointer", this.readout),
      el("footer", {}, this.statusLine,
        el("p", { className: "note", textContent: `Lookups of the light a pixel: ${group(lookups.moving)} while moving, ${group(lookups.still)} in ${lookups.passes} passes when still.` }),
        el("button", { type: "button", id: "help", textContent: "Keys  ?", onclick: () => this.help() })),
    ].filter(Boolean));
    this.keys = el("dialog", { id: "keys" }, el("h2", { textContent: "Keys" }),
      el("dl", {}, KEYS.map(([key, what]) => [el("dt", { textContent: key }), el("dd", { textContent: what })])),
      el("p", { className: "note", textContent: "Drag to orbit, wheel or pinch to come nearer, right button or two fingers to move. Shift and drag turns the light. Drop an .hdr or .exr file anywhere to light the object with it." }),
      el("form", { method: "dialog" }, el("button", { textContent: "Close" })));
    document.body.append(this.keys);
    this.handle = el("div", { id: "handle", role: "slider", tabIndex: 0, hidden: true, title: "photograph | material" });
    this.handle.setAttribute("aria-label", "photograph left, material right");
    document.getElementById("view").append(this.handle);
    this.toggle = el("button", { id: "toggle", type: "button", title: "hide or show the panel (H)", textContent: "☰", onclick: () => this.hide() });
    document.getElementById("view").append(this.toggle);
    this.refresh();
  }

  #listen() {
    const { viewer } = this, { canvas } = viewer;
    const guarded = (work) => (event) => Promise.resolve(work(event)).catch((error) => this.say(error.message));
    this.light.onchange = guarded(() => this.pickLight(Number(this.light.value)));
    this.convention.onchange = guarded(() => viewer.setConvention(this.convention.value));
    this.turn.oninput = () => this.rotate(Number(this.turn.value));
    this.ev.oninput = () => this.expose(Number(this.ev.value));
    this.backdrop.onchange = () => this.showBackdrop(this.backdrop.checked);
    this.map.onchange = guarded(() => this.pickMap(Number(this.map.value)));
    this.shots.onchange = guarded(() => this.pickShot(this.shots.value === "" ? null : Number(this.shots.value)));
    this.file.onchange = guarded(() => this.open(this.file.files[0]));
    this.object.onclick = () => this.pickSphere(null);
    this.chips.forEach((chip, n) => {
      chip.onclick = () => this.pickSphere(viewer.onSphere && viewer.chosen === n ? null : n);
    });
    addEventListener("keydown", guarded((event) => this.key(event)));
    addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("dropping"); });
    addEventListener("dragleave", (event) => event.relatedTarget ?? document.body.classList.remove("dropping"));
    addEventListener("drop", guarded((event) => {
      event.preventDefault();
      document.body.classList.remove("dropping");
      return this.open(event.dataTransfer.files[0]);
    }));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 0) this.point(event.offsetX, event.offsetY);
    });
    canvas.addEventListener("pointerleave", () => this.point(-1, -1));
    canvas.addEventListener("click", (event) => this.point(event.offsetX, event.offsetY));
    // Shift and drag turns the light; the orbit must not see it.
    canvas.addEventListener("pointerdown", (event) => {
      if (!event.shiftKey) return;
      event.stopImmediatePropagation();
      event.preventDefault();
      const start = event.clientX, from = Number(this.turn.value);
      this.#drag(canvas, event, (e) => this.rotate(wrap(from + (e.clientX - start) * 0.5)));
    }, true);
    this.handle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      this.#drag(this.handle, event, (e) => this.split((e.clientX - canvas.getBoundingClientRect().left) / canvas.clientWidth));
    });
    this.handle.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!step) return;
      event.stopPropagation();
      viewer.stage.split = Math.min(1, Math.max(0, viewer.stage.split + step));
      viewer.stage.change("shown");
      this.placeHandle();
    });
    new ResizeObserver(() => (viewer.stage.change(), this.placeHandle())).observe(canvas);
  }

  #drag(element, event, move) {
    element.setPointerCapture(event.pointerId);
    const stop = () => {
      element.removeEventListener("pointermove", move);
      element.removeEventListener("pointerup", stop);
      element.removeEventListener("pointercancel", stop);
    };
    element.addEventListener("pointermove", move);
    element.addEventListener("pointerup", stop);
    element.addEventListener("pointercancel", stop);
  }

  async pickLight(number) {
    await this.viewer.setLight(number);
    this.refresh();
  }

  async open(file) {
    if (!file) return;
    this.say(`reading ${file.name}…`);
    const raster = await readProbe(file), { up } = this.viewer.head;
    const convention = raster.width === raster.height ? "debevec-angular" : up[1] !== 0 ? "mitsuba" : "blender";
    await this.viewer.addLight(file.name, raster, convention);
    this.say(`${file.name}, read as ${CONVENTION_WORDS[convention]}`);
    this.refresh();
  }

  rotate(degrees) {
    this.viewer.rotate((degrees * Math.PI) / 180);
    this.turn.value = degrees;
    this.turnOut.value = `${Math.round(degrees)}°`;
  }

  expose(ev) {
    this.viewer.expose(ev);
    this.ev.value = ev;
    this.evOut.value = `${ev > 0 ? "+" : ""}${ev.toFixed(1)} EV`;
  }

  showBackdrop(shown) {
    this.backdrop.checked = this.viewer.stage.backdrop = shown;
    this.viewer.stage.change("shown");
  }

  async pickMap(number) {
    await this.viewer.map(this.maps[number].value);
    this.map.value = number;
    this.refresh();
  }

  async pickSphere(index) {
    this.viewer.sphere(index);
    if (this.viewer.stage.map?.kind === 2) await this.viewer.map(this.viewer.stage.map);
    this.refresh();
  }

  async pickShot(number) {
    await this.viewer.compare(number);
    if (number !== null) this.rotate(0);
    this.refresh();
  }

  leavePhotograph() {
    this.viewer.shot = this.viewer.stage.photograph = null;
    this.refresh();
  }

  /** The line between photograph and material, as a share of the canvas. */
  split(share) {
    const { stage, shot } = this.viewer;
    if (!shot) return;
    const [x, , w] = this.#frame();
    stage.split = Math.min(1, Math.max(0, (share * this.viewer.canvas.clientWidth - x) / w));
    stage.change("shown");
    this.placeHandle();
  }

  #frame() {
    const { canvas, stage } = this.viewer;
    return stage.camera(canvas.clientWidth, canvas.clientHeight).lens.frame;
  }

  placeHandle() {
    this.handle.hidden = !this.viewer.shot;
    if (!this.viewer.shot) return;
    const [x, y, w, h] = this.#frame();
    Object.assign(this.handle.style, { left: `${x + this.viewer.stage.split * w}px`, top: `${y}px`, height: `${h}px` });
    this.handle.setAttribute("aria-valuenow", Math.round(100 * this.viewer.stage.split));
  }

  point(x, y) {
    clearTimeout(this.pointing);
    this.pointing = setTimeout(() => {
      const found = x >= 0 ? this.viewer.at(x, y) : null, { material } = this.viewer.head;
      if (!found) {
        this.readout.replaceChildren(el("span", { className: "note", textContent: this.viewer.onSphere ? "a single representative" : "nothing of the object" }));
        return;
      }
      this.readout.replaceChildren(
        ...found.blend.map(([n, w]) => el("div", { className: "weight" }, el("i", { style: `background:${material.colours[n % material.colours.length]}` }),
          el("span", { textContent: `${n + 1}` }), el("b", { style: `width:${(100 * w).toFixed(1)}%;background:${material.colours[n % material.colours.length]}` }), el("output", { value: `${(100 * w).toFixed(1)} %` }))),
        ...found.values.map((v) => el("div", { className: "value" }, el("span", { textContent: v.name }),
          el("output", { value: v.value === null ? "none" : (v.most ? "≥ " : "") + number_(v.value, v.unit) }))));
    }, 25);
  }

  async key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (/SELECT|INPUT|TEXTAREA/.test(event.target.tagName) && event.key.startsWith("Arrow")) return;
    const { viewer } = this, { orbit, head } = viewer, step = event.shiftKey ? 0.3 : 0.1;
    const cycle = (value, count) => (value + 1) % count;
    const does = {
      ArrowLeft: () => orbit.turn(-step, 0), ArrowRight: () => orbit.turn(step, 0),
      ArrowUp: () => orbit.turn(0, step), ArrowDown: () => orbit.turn(0, -step),
      "+": () => orbit.turn(0, 0, 1.1), "=": () => orbit.turn(0, 0, 1.1), "-": () => orbit.turn(0, 0, 1 / 1.1),
      "[": () => this.rotate(wrap(Number(this.turn.value) - 5)), "]": () => this.rotate(wrap(Number(this.turn.value) + 5)),
      ",": () => this.expose(Math.max(-5, Number(this.ev.value) - 0.2)), ".": () => this.expose(Math.min(5, Number(this.ev.value) + 0.2)),
      l: () => this.pickLight(cycle(viewer.light, viewer.lights.length)),
      p: () => head.shots.length && this.pickShot(viewer.shot ? cycle(head.shots.indexOf(viewer.shot), head.shots.length) : 0),
      m: () => this.pickMap(cycle(Number(this.map.value), this.maps.length)),
      s: () => this.pickSphere(viewer.onSphere ? cycle(viewer.chosen, head.material.N) : viewer.chosen),
      o: () => this.pickSphere(null), b: () => this.showBackdrop(!this.backdrop.checked),
      r: () => (orbit.reset(), this.rotate(0), this.expose(0), this.pickShot(null)), h: () => this.hide(), "?": () => this.help(),
      Escape: () => viewer.shot && this.pickShot(null),
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!does || this.keys.open) return;
    event.preventDefault();
    await does();
  }

  help() {
    this.keys.showModal();
  }

  hide() {
    document.body.classList.toggle("bare");
  }

  say(text) {
    this.said = { text, until: performance.now() + 8000 };
    this.#status();
    setTimeout(() => this.#status(), 8100);
  }

  refresh() {
    const { viewer } = this, { head } = viewer;
    if (this.light.childElementCount !== viewer.lights.length)
      this.light.replaceChildren(...viewer.lights.map((l, k) => el("option", { textContent: l.name, value: k })));
    this.light.value = viewer.light;
    const current = viewer.lights[viewer.light];
    // The viewer drops a map where it has no meaning.
    if (!viewer.stage.map) this.map.value = 0;
    this.conventionRow.hidden = !current.dropped;
    this.convention.value = current.convention;
    this.rotate(Math.round((viewer.stage.angle * 180) / Math.PI));
    this.expose(viewer.stage.ev);
    this.shots.value = viewer.shot ? head.shots.indexOf(viewer.shot) : "";
    this.object.classList.toggle("on", !viewer.onSphere);
    this.chips.forEach((chip, n) => chip.classList.toggle("on", viewer.onSphere && viewer.chosen === n));
    this.chipNote.textContent = viewer.onSphere ? head.material.notes[viewer.chosen] ?? "" : "";
    this.legend.replaceChildren(...this.#legend(this.maps[Number(this.map.value)]));
    if (!this.readout.childElementCount) this.point(-1, -1);
    this.placeHandle();
  }

  #legend(map) {
    if (map.legend === "chips") return [el("span", { className: "note", textContent: "in the colours of the representatives below" })];
    if (map.legend !== "heat") return [];
    const of = map.value.kind === 2 ? [el("span", { className: "note", textContent: `of representative ${this.viewer.chosen + 1}; choose another below` })] : [];
    return [el("div", { className: "bar" }, "0", el("i"), `${map.top}${map.value.kind === 2 ? "" : " and above"}`), ...of,
      ...(map.none ? [el("span", { className: "note", textContent: "grey: none known" })] : [])];
  }

  #status() {
    const { stats, map } = this.viewer.stage, said = this.said && performance.now() < this.said.until;
    const done = stats.passes >= stats.total;
    this.statusLine.textContent = said ? this.said.text : map ? "" : done ? "all passes drawn" : `pass ${stats.passes} of ${stats.total}`;
    document.body.classList.toggle("still", done);
  }

  #theme() {
    const stage = getComputedStyle(document.documentElement).getPropertyValue("--stage").trim();
    this.viewer.stage.ground = rgb(stage);
    this.viewer.stage.change("shown");
  }
}

const section = (title, ...children) => el("section", {}, el("h2", { textContent: title }), ...children);
const group = (count) => count.toLocaleString("en");
const wrap = (degrees) => ((((degrees + 180) % 360) + 360) % 360) - 180;

/** A number with its unit; a fraction in per cent. */
function number_(value, unit) {
  return unit === "%" ? `${(100 * value).toFixed(1)} %` : `${value >= 10 ? Math.round(value) : value.toPrecision(2)}${unit ? ` ${unit}` : ""}`;
}
