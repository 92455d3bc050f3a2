// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// node build.mjs BUNDLE: one script for any page, from src/ and three.js.
import { readFile, rename } from "node:fs/promises";
import * as esbuild from "esbuild";

const [bundle] = process.argv.slice(2);
const license = await readFile("node_modules/three/LICENSE", "utf8");
const banner = `
Swatchwork's viewer, with three.js, and fflate (copyright 2023 Arjun Barrett, same license).

${license}
three.js's EXRLoader is made from others' code:

${await noticesOf("node_modules/three/examples/jsm/loaders/EXRLoader.js", ["Syoyo Fujita", "Industrial Light & Magic"])}
`;
if (banner.includes("*/")) throw new Error("a notice would end the comment that it stands in");
await esbuild.build({
  entryPoints: ["src/main.js"],
  outfile: `${bundle}.partial`,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "eof",
  banner: { js: `/*${banner}*/` },
});
await rename(`${bundle}.partial`, bundle);

/** The notices among a file's comments of lines, which no bundler knows for such; of so many holders, or it fails. */
async function noticesOf(file, holders) {
  const lines = (await readFile(file, "utf8")).split("\n").filter((line) => line.startsWith("//"));
  const text = lines.map((line) => line.replace(/^[/ ]+/, "").replace(/^\*\/?$/, "")).join("\n");
  for (const holder of holders)
    if (!text.includes(holder) || !/Redistributions in binary form/.test(text)) throw new Error(`${file} has no notice of ${holder}`);
  return text.replace(/\n{3,}/g, "\n\n").trim();
}
