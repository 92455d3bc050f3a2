// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// Brings the parts together: panes ask for points to be placed, pairs change, the server says the pose.

import { Pinhole, scale, add } from "./algebra.js";
import { bindKeys } from "./keys.js";
import { MeshPane } from "./mesh.js";
import { Pairs } from "./pairs.js";
import { PhotoPane } from "./photo.js";
import { Poses } from "./poses.js";
import { ask, get, post } from "./server.js";
import { showList, showPhotographs, showPose, showPrompt } from "./side.js";

const SETTLED_MS = 120; // after the last motion, before the server is asked about the new view
const $ = (id) => document.getElementById(id);
const state = await (await get("state")).json();
const { centre, radius } = state.mesh;
const inBall = (x) => scale(add(x, centre, -1), 1 / radius);
const colour = (number) => state.palette[(number - 1) % state.palette.length];

const pairs = new Pairs(state.photographs, state.pairs);
const poses = new Poses(pairs, state.fewest);
let trouble = "";
let hidden = new Set();

function later(work) {
  let timer;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(work, SETTLED_MS);
  };
}

/** Of answers to one kind of question only the last asked counts. */
function latest(work) {
  let asked = 0;
  return async (...given) => {
    const mine = ++asked;
    try {
      await work(() => mine === asked, ...given);
    } catch (error) {
      tell(error.message);
    }
  };
}

function tell(text) {
  trouble = text;
  showPrompt(pairs, poses.answer, state.fewest, colour, trouble);
}

/** The mesh's last answer to a point placed on it: what is placed on the photograph comes after it. */
let placing = Promise.resolve();

async function pick(at) {
  const { eye } = mesh.view;
  return (await ask("pick", { origin: eye, direction: mesh.view.ray(at) })).x_in_mesh;
}

const common = {
  waits: () => pairs.moving || pairs.open !== undefined,
  select: (number) => pairs.select(number),
  grab: (number) => {
    pairs.remember();
    pairs.select(number);
  },
  drop: () => pairs.told(),
};
const photo = new PhotoPane($("photo"), {
  ...common,
  place: async (at) => {
    const [u, v] = photo.toImage(at);
    if (u < 0 || v < 0 || u > photo.width || v > photo.height) return tell("That is beside the photograph.");
    await placing.catch(() => undefined);
    trouble = "";
    return pairs.place("uv", [u, v]);
  },
  drag: (number, at) => pairs.shift(number, "uv", photo.toImage(at).map((v, i) => Math.min(Math.max(v, 0), i ? photo.height : photo.width))),
  changed: later(() => drawOutline()),
  aimed: ([u, v]) => ($("photo-at").textContent = `${u.toFixed(1)}, ${v.toFixed(1)}`),
});
const mesh = new MeshPane($("mesh"), {
  ...common,
  place: latest(async (current, at) => {
    placing = pick(at);
    const x = await placing;
    if (!current()) return;
    if (!x) return tell("That is beside the mesh.");
    trouble = "";
    pairs.place("x", x);
  }),
  drag: latest(async (current, number, at) => {
    const x = await pick(at);
    if (x && current() && pairs.find(number)) pairs.shift(number, "x", x);
  }),
  changed: later(() => settle()),
});

/** What the mesh hides of the points, and what lies in the middle of the pane, about which it turns. */
const settle = latest(async (current) => {
  const shown = pairs.list.filter((p) => p.x);
  const [found, middle] = await Promise.all([
    ask("hidden", { eye: mesh.view.eye, x_in_mesh: shown.map((p) => p.x) }),
    pick(mesh.middle),
  ]);
  if (!current()) return;
  hidden = new Set(shown.filter((_, i) => found.hidden[i]).map((p) => p.number));
  mesh.pivot = middle ? inBall(middle) : [0, 0, 0];
  showMarkers();
});

const drawOutline = latest(async (current) => {
  const found = poses.current;
  if (!found || photo.opacity === 0) return photo.setOutline(undefined);
  const { window, size } = photo;
  const drawn = size.map((v) => Math.max(1, Math.min(2400, Math.round(v * Math.min(devicePixelRatio, 2)))));
  const answer = await post("outline", { world_from_camera: found.world_from_camera, window, size: drawn });
  const picture = await createImageBitmap(await answer.blob());
  if (current()) photo.setOutline(picture, window);
});

async function findPose(name) {
  if ((await poses.find(name)) && name === pairs.photograph) drawOutline();
}

function showMarkers() {
  const marker = (p, point) => ({
    number: p.number,
    colour: colour(p.number),
    point,
    selected: p.number === pairs.selected,
    off: poses.residual(p.number)?.fits === false,
  });
  photo.markers = pairs.list.filter((p) => p.uv).map((p) => marker(p, p.uv));
  mesh.markers = pairs.list.filter((p) => p.x).map((p) => ({ ...marker(p, inBall(p.x)), hidden: hidden.has(p.number) }));
  photo.residuals = pairs.complete().flatMap((p) => {
    const to = poses.residual(p.number)?.at;
    return to && to.every((v) => v !== null) ? [{ from: p.uv, to, colour: colour(p.number) }] : [];
  });
  photo.redraw();
  mesh.redraw();
}

function show() {
  const found = poses.answer;
  showPhotographs(pairs, poses.of, (name) => pairs.show(name));
  showPrompt(pairs, found, state.fewest, colour, trouble);
  showPose(pairs, found, state.fewest, state.recommended);
  showList(pairs, (number) => poses.residual(number), colour, {
    select: reveal,
    move: (number) => {
      reveal(number);
      pairs.select(number, true);
    },
    remove: (number) => pairs.remove(number),
  });
  $("undo").disabled = !pairs.past.length;
  $("redo").disabled = !pairs.future.length;
  $("save").disabled = !pairs.changed;
  $("file").textContent = pairs.changed ? "Not saved yet" : pairs.text() === pairs.empty ? "" : `Saved in ${state.output}`;
  $("photo-name").textContent = pairs.photograph;
  document.body.classList.toggle("begun", pairs.complete().length > 1);
  showMarkers();
}

function reveal(number) {
  pairs.select(number);
  const { uv, x } = pairs.current;
  if (uv) photo.reveal(uv);
  const at = x && mesh.toScreen(inBall(x));
  if (x && (hidden.has(number) || at.some((v, i) => !(v > 20 && v < mesh.size[i] - 20)))) mesh.reveal(inBall(x));
}

let shown = {}; // the photograph on screen, and how bright
const showPhotograph = latest(async (current, keep) => {
  const name = pairs.photograph;
  const stops = Number($("stops").value);
  if (shown.name === name && shown.stops === stops) return;
  shown = { name, stops };
  photo.stage.classList.toggle("busy", !keep);
  if (!keep) photo.setOutline(undefined);
  let picture;
  try {
    const answer = await get(`photograph?number=${state.photographs.indexOf(name)}&stops=${stops}`);
    picture = await createImageBitmap(await answer.blob());
  } finally {
    if (current()) photo.stage.classList.remove("busy");
  }
  if (!current()) return;
  photo.base.style.filter = "";
  photo.show(picture, keep);
  drawOutline();
});

async function changed() {
  const name = pairs.photograph;
  if (trouble) trouble = "";
  show();
  if (shown.name !== name) showPhotograph(false);
  try {
    await findPose(name);
    show();
    // Undo may have changed another one.
    for (const other of state.photographs) await findPose(other);
  } catch (error) {
    return tell(error.message);
  }
  show();
  return settleLater();
}
const settleLater = later(() => settle());

function fromCamera() {
  const found = poses.current;
  if (!found) return;
  const { fx, fy, cx, cy } = state.lens;
  const m = found.world_from_camera;
  const column = (i) => [m[0][i], m[1][i], m[2][i]];
  const [px, py] = photo.toScreen([cx, cy]).map((v, i) => v + (mesh.size[i] - photo.size[i]) / 2);
  mesh.look(new Pinhole(inBall(column(3)), column(0), column(1), column(2), ((fx + fy) / 2) * photo.zoomed, px, py));
}

async function save() {
  const text = pairs.text();
  try {
    await post("save", { photographs: pairs.written() });
  } catch (error) {
    return tell(`Not saved: ${error.message}`);
  }
  pairs.asSaved = text;
  trouble = "";
  return show();
}

pairs.addEventListener("change", changed);
bindKeys({ pairs, photo, mesh, save, fromCamera });
$("undo").addEventListener("click", () => pairs.undo());
$("redo").addEventListener("click", () => pairs.redo());
$("save").addEventListener("click", save);
$("from-camera").addEventListener("click", fromCamera);
$("help-open").addEventListener("click", () => $("help").showModal());
$("outline").addEventListener("input", (e) => {
  photo.opacity = Number(e.target.value);
  if (photo.outline || !photo.opacity) photo.redraw();
  else drawOutline();
});
// While the slider moves the browser brightens what is there; then the server does, from the full range.
$("stops").addEventListener("input", (e) => {
  const by = Number(e.target.value) - shown.stops;
  photo.base.style.filter = `brightness(${2 ** (by / 2.2)})`;
});
$("stops").addEventListener("change", () => showPhotograph(true));
addEventListener("beforeunload", (e) => {
  if (pairs.changed) e.preventDefault();
});

[...document.querySelectorAll(".brand i")].forEach((i, n) => (i.style.background = state.palette[n]));
document.title = `Pairs: ${state.mesh.name} - Swatchwork`;
$("mesh-name").textContent = `${state.mesh.name}, ${state.mesh.faces.toLocaleString("en")} triangles`;
const first = showPhotograph(false);
changed();
mesh.stage.classList.add("busy");
mesh.load(await (await get("mesh")).arrayBuffer(), state.mesh.vertices, state.mesh.faces);
mesh.stage.classList.remove("busy");
await first;
// For the browser's console, and for tests: where things are on the screen.
globalThis.swatchwork = { photo, mesh, pairs, poses, inBall };
document.body.dataset.ready = "";
