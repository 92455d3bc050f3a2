// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT
// Questions to the server; an answer that is not 200 becomes an Error with the server's words.

async function answered(response) {
  if (response.ok) return response;
  const { error } = await response.json().catch(() => ({}));
  throw new Error(error ?? `the server answered ${response.status}`);
}

async function reached(path, options) {
  try {
    return await fetch(path, options);
  } catch {
    throw new Error("swatchwork does not answer: was it ended in the terminal? Start it again and save there");
  }
}

export async function get(path) {
  return answered(await reached(path));
}

export async function post(path, body) {
  const headers = { "Content-Type": "application/json" };
  return answered(await reached(path, { method: "POST", headers, body: JSON.stringify(body) }));
}

export const ask = async (path, body) => (await post(path, body)).json();
