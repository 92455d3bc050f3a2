// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// The text around the panes: the strip of photographs, what to do next, the pose, the list.

import { inkOn } from "./markers.js";

const $ = (id) => document.getElementById(id);

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

function dot(number, colour) {
  const made = element("b", { class: "dot" }, String(number));
  made.style.color = inkOn(colour);
  made.style.background = colour; // by script: the page's policy allows no style attributes
  return made;
}

/** A button for each photograph, with how many pairs it has and how well they fit. */
export function showPhotographs(pairs, poses, choose) {
  const names = Object.keys(pairs.of);
  const button = (name) => {
    const count = pairs.complete(name).length;
    const rms = poses[name]?.rms_px;
    const state = rms === undefined ? `${count || "no"} pairs` : `${count} pairs, ${rms.toFixed(2)} px`;
    const current = String(name === pairs.photograph);
    return element("button", { "aria-current": current, onclick: () => choose(name) }, name, element("span", { class: "n" }, state));
  };
  const strip = $("photographs");
  const before = strip.scrollLeft;
  replaced(strip, names.map(button));
  strip.scrollLeft = before;
  strip.querySelector("[aria-current=true]").scrollIntoView({ block: "nearest", inline: "nearest" });
}

/** What to do next, in the words of the person's work. */
export function showPrompt(pairs, pose, fewest, colour, trouble) {
  const prompt = $("prompt");
  const { open, current, moving } = pairs;
  const missing = fewest - pairs.complete().length;
  const misfits = pose?.inliers ? pose.numbers.filter((_, i) => !pose.inliers[i]) : [];
  const about = moving ? [current.number] : open ? [open.number] : misfits;
  let text;
  if (trouble) text = trouble;
  else if (moving) text = "Click its new place on the photograph or on the mesh. Esc leaves it where it is.";
  else if (open) text = `Now click the same point on the ${open.uv ? "mesh" : "photograph"}.`;
  else if (missing === fewest) text = "Click a point on the photograph, then the same point on the mesh: a corner, a tip, the end of a crease.";
  else if (missing > 0) text = `Next point. ${missing} more ${missing === 1 ? "pair makes" : "pairs make"} a pose; well apart is best.`;
  else if (!pose) text = "Finding the pose.";
  else if (pose.reason) text = `No pose: ${pose.reason}`;
  else if (misfits.length) text = `${misfits.length > 1 ? "do" : "does"} not fit the others: move or delete what is wrong.`;
  else text = "Does the outline lie on the object? Then save. If not, add pairs where it is off.";
  prompt.classList.toggle("bad", Boolean(trouble || pose?.reason));
  const said = [...(trouble ? [] : about.map((number) => dot(number, colour(number)))), text];
  if (prompt.textContent !== said.map((s) => s.textContent ?? s).join("")) prompt.replaceChildren(...said);
  const next = trouble || moving ? "" : open ? (open.uv ? "mesh" : "photo") : missing > 0 ? "photo" : "";
  for (const id of ["photo", "mesh"]) $(id).classList.toggle("next", id === next);
}

export function showPose(pairs, pose, fewest, recommended) {
  const found = pose?.rms_px !== undefined;
  const off = found ? pose.inliers.filter((fits) => !fits).length : 0;
  const count = pairs.complete().length;
  replaced($("rms"), pose?.reason ? ["None"] : found ? [pose.rms_px.toFixed(2), element("small", {}, "px rms")] : [`${Math.min(count, fewest)} of ${fewest}`, element("small", {}, "pairs")]);
  const [note, kind] = noteOf(pairs, pose, off, fewest, recommended);
  $("pose-note").textContent = note;
  $("pose-note").className = `note ${kind}`;
  $("outline-row").hidden = !found;
  $("from-camera").disabled = !found;
}

/** What to think of the pose, and whether that is "good" or "off". */
function noteOf(pairs, pose, off, fewest, recommended) {
  const count = pairs.complete().length;
  if (pose?.reason) return ["The pairs contradict each other, or say too little.", "off"];
  if (pose?.rms_px === undefined) return [`The pose comes with pair ${fewest}.`, ""];
  if (pose.focal_fits) return [`A focal length of ${pose.focal_fits.toFixed(2)} times the given one fits better. Are the intrinsics of this lens and focus?`, "off"];
  if (pose.ambiguous) return ["Another pose fits nearly as well: add points that differ in depth.", "off"];
  if (off) return [`${off} of ${count} pairs ${off === 1 ? "does" : "do"} not fit and ${off === 1 ? "is" : "are"} left out.`, "off"];
  if (count < recommended) return [`${count} pairs fit. With ${recommended} or more a slip shows.`, ""];
  return [`All ${count} pairs fit.`, "good"];
}

/** does: {select, move, remove}, each of a number. */
export function showList(pairs, residual, colour, does) {
  $("count").textContent = pairs.list.length || "";
  const row = ({ number, uv, x }) => {
    const left = residual(number);
    const words = !uv ? "photograph?" : !x ? "mesh?" : left ? `${left.px === null ? "unseen" : left.px.toFixed(2) + " px"}${left.fits ? "" : " off"}` : "placed";
    const selected = number === pairs.selected;
    const pick = element(
      "button",
      { class: `pick ${left && !left.fits ? "off" : ""}`, "aria-pressed": String(selected), "aria-label": `Pair ${number} ${words}`, "data-key": `pick-${number}`, onclick: () => does.select(number) },
      dot(number, colour(number)),
      words,
    );
    const act = (name, label) =>
      element("button", { class: "act", "aria-label": `${label} pair ${number}`, "data-key": `${name}-${number}`, onclick: () => does[name](number) }, label);
    return element("li", { class: selected ? "selected" : "", "data-number": number }, pick, act("move", "Move"), act("remove", "Delete"));
  };
  const rows = pairs.list.map(row);
  replaced($("list"), rows.length ? rows : [element("li", { class: "empty" }, "None yet. Each will show how well it fits the pose.")]);
  $("list").querySelector(".selected")?.scrollIntoView({ block: "nearest" });
}

/** Exchange children and leave the keyboard's focus on the one that stands for the same. */
function replaced(parent, children) {
  const held = parent.contains(document.activeElement) ? document.activeElement : undefined;
  const place = held && [...parent.querySelectorAll("button")].indexOf(held);
  parent.replaceChildren(...children);
  if (!held) return;
  const buttons = [...parent.querySelectorAll("button")];
  (buttons.find((b) => b.dataset.key && b.dataset.key === held.dataset.key) ?? buttons[Math.min(place, buttons.length - 1)])?.focus();
}
