// Asking the server, and ordering. Every order is a message on the bus; what comes of it is heard there (live.js).

import { toast } from "./dom.js";

let csrf = "";

export class Refused extends Error {}

async function read(answer) {
  const told = await answer.json().catch(() => ({}));
  if (!answer.ok) throw new Refused(told.error ?? `the server answered ${answer.status}`);
  if (told.csrf !== undefined) csrf = told.csrf ?? "";
  return told;
}

async function sent(path, options) {
  try {
    return await fetch(path, options);
  } catch {
    throw new Refused("the dashboard's server does not answer");
  }
}

export async function get(path) {
  return read(await sent(path, {}));
}

export async function post(path, body) {
  const headers = { "X-CSRF-Token": csrf, "Content-Type": "application/json" };
  return read(await sent(path, { method: "POST", headers, body: JSON.stringify(body ?? {}) }));
}

/** The same for a control: a refusal is told, and the answer is null then. */
export async function order(path, body) {
  try {
    return await post(path, body);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    toast(error.message, "bad");
    return null;
  }
}
