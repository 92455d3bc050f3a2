// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// node build.mjs BUNDLE: one script for any page, from src/ and three.js.
import { readFile, rename } from "node:fs/promises";
import * as esbuild from "esbuild";

const [bundle] = process.argv.slice(2);
const license = await readFile("node_modules/three/LICENSE", "utf8");
await esbuild.build({
  entryPoints: ["src/main.js"],
  outfile: `${bundle}.partial`,
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  banner: { js: `/*\nSwatchwork's viewer, with three.js, and fflate (copyright 2023 Arjun Barrett, same license).\n\n${license}*/` },
});
await rename(`${bundle}.partial`, bundle);
