// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// What both panes draw over their picture: numbered markers and the crosshair.

export const REACH = 9;

/** Black or white, whichever is read better on "#rrggbb". */
export function inkOn(colour) {
  const [r, g, b] = [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
  return 0.3 * r + 0.59 * g + 0.11 * b > 145 ? "#1b1a17" : "#fff";
}

/** A ring that leaves its point free, and its number beside it. marker: {number, colour, at, selected, hidden, off}. */
export function drawMarker(c, { number, colour, at: [x, y], selected, hidden, off }) {
  if (!Number.isFinite(x + y)) return;
  c.save();
  c.globalAlpha = hidden ? 0.4 : 1;
  const radius = selected ? 9 : 7;
  if (hidden) c.setLineDash([3, 3]);
  for (const [width, style] of [[selected ? 6 : 4.5, "#000a"], [selected ? 3 : 2, colour]]) {
    c.lineWidth = width;
    c.strokeStyle = style;
    c.beginPath();
    c.arc(x, y, radius, 0, 2 * Math.PI);
    c.stroke();
  }
  c.setLineDash([]);
  if (selected) ring(c, x, y, radius + 3.5, "#fff", 1.5);
  c.fillStyle = "#000a";
  c.fillRect(x - 1.5, y - 1.5, 3, 3);
  c.fillStyle = "#fff";
  c.fillRect(x - 0.5, y - 0.5, 1, 1);
  const text = off ? `${number} !` : `${number}`;
  c.font = "700 12px ui-sans-serif, system-ui, sans-serif";
  const wide = c.measureText(text).width + 10;
  const [left, top] = [x + radius + 3, y - radius - 12];
  c.fillStyle = colour;
  c.strokeStyle = "#000a";
  c.lineWidth = 1.5;
  c.beginPath();
  c.roundRect(left, top, wide, 17, 8.5);
  c.fill();
  c.stroke();
  c.fillStyle = inkOn(colour);
  c.textBaseline = "middle";
  c.fillText(text, left + 5, top + 9);
  c.restore();
}

function ring(c, x, y, radius, style, width) {
  c.lineWidth = width;
  c.strokeStyle = style;
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.stroke();
}

/** Where the pose puts a point of the mesh: a line from the click, and a small cross. */
export function drawResidual(c, [x, y], [to_x, to_y], colour) {
  for (const [width, style] of [[3.5, "#000a"], [1.5, colour]]) {
    c.lineWidth = width;
    c.strokeStyle = style;
    c.beginPath();
    c.moveTo(x, y);
    c.lineTo(to_x, to_y);
    c.moveTo(to_x - 4, to_y - 4);
    c.lineTo(to_x + 4, to_y + 4);
    c.moveTo(to_x - 4, to_y + 4);
    c.lineTo(to_x + 4, to_y - 4);
    c.stroke();
  }
}

export function drawCrosshair(c, [x, y]) {
  for (const [width, style] of [[4, "#000b"], [1.5, "#fff"]]) {
    c.lineWidth = width;
    c.strokeStyle = style;
    c.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      c.moveTo(x + 4 * dx, y + 4 * dy);
      c.lineTo(x + 20 * dx, y + 20 * dy);
    }
    c.stroke();
  }
  c.fillStyle = "#fff";
  c.fillRect(x - 0.5, y - 0.5, 1, 1);
}
