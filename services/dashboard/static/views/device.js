// One item of the home: its value, and the control that fits its type.

import * as api from "../api.js";
import { h, icon, text, WORDS } from "../dom.js";

const CONFIRM_S = 6;
export const NOTHING = new Set(["NULL", "UNDEF", ""]); // what an item says that nobody has told anything, or whose state was taken away
const UNKNOWN = ", state unknown"; // for who hears a label only

/** The element of an item, and what takes its states. */
export function card(name, item, may) {
  const value = h("span", { class: "value" }, "–");
  const note = h("span", { class: "note" });
  const waiting = new Waiting(name, note, (busy) => {
    element.classList.toggle("pending", busy);
    element.setAttribute("aria-busy", busy ? "true" : "false");
  });
  const control = may && item.commands ? controlOf(item, (command, confirms) => waiting.send(command, confirms)) : null;
  const title = h("span", { class: "title" }, h("span", { class: "name" }, item.label), note);
  const element = h("div", { class: "card", "data-item": name }, icon(item.icon), title, control?.tells ? null : value, control?.element);
  const known = (is) => {
    element.classList.toggle("unknown", !is);
    value.hidden = is && Boolean(control?.hides);
    control?.known?.(is);
  };
  known(false);
  return {
    element,
    label: item.label,
    close: () => waiting.close(),
    state(entry) {
      const shown = readable(item, entry.text);
      text(value, shown);
      element.classList.toggle("on", isOn(item, entry.text));
      known(!NOTHING.has(entry.text));
      control?.show(entry.text, shown);
      waiting.heard(entry.text, entry.fresh);
    },
  };
}

/** A command that nobody has confirmed yet. */
class Waiting {
  constructor(name, note, show) {
    Object.assign(this, { name, note, show, timer: 0, confirms: null });
  }

  /** `confirms` tells whether a state does; null: none has to, the command itself is all (a STOP, a NEXT). */
  async send(command, confirms = (state) => state === command) {
    clearTimeout(this.timer);
    this.confirms = confirms;
    text(this.note, "");
    this.show(true);
    this.timer = setTimeout(() => this.done("no answer"), CONFIRM_S * 1000);
    const said = await api.order(`/api/items/${this.name}/command`, { value: command });
    if (said === null) this.done("not sent");
    else if (confirms === null) this.done("");
  }

  heard(state, fresh) {
    if (this.confirms && fresh && this.confirms(state)) this.done("");
  }

  done(why) {
    clearTimeout(this.timer);
    this.confirms = null;
    text(this.note, why);
    this.show(false);
    if (why) this.repair?.();
  }

  close() {
    clearTimeout(this.timer);
  }
}

const number = (state) => Number.parseFloat(state);

function readable(item, state) {
  if (NOTHING.has(state)) return "–";
  if (item.options[state]) return item.options[state];
  if (item.type === "DateTime") {
    const when = new Date(state.replace(/([+-]\d\d)(\d\d)$/, "$1:$2"));
    return Number.isNaN(when.getTime()) ? state : when.toLocaleString([], { dateStyle: "short", timeStyle: "short" });
  }
  if (item.type === "Dimmer" || item.type === "Rollershutter") return `${state} %`;
  if (item.type === "Contact" || (item.type === "Switch" && !item.commands)) return WORDS[state] ?? state;
  if (item.type === "Number" && item.unit && /^[-+.\d]+$/.test(state)) return `${state} ${item.unit}`;
  return state;
}

function isOn(item, state) {
  if (item.type === "Switch" || item.type === "Contact") return state === "ON" || state === "OPEN";
  if (item.type === "Dimmer") return number(state) > 0;
  if (item.type === "Color") return number(state.split(",")[2]) > 0;
  return item.type === "Player" && state === "PLAY";
}

function controlOf(item, send) {
  const made = CONTROLS[item.type] ?? (Object.keys(item.options).length ? choice : null);
  if (item.type === "String" && !Object.keys(item.options).length) return null;
  return made ? made(item, send) : null;
}

/** What adds to a control's label that its state is unknown; controls whose value stands beside them need none. */
function naming(element) {
  const label = element.getAttribute("aria-label");
  return (known) => element.setAttribute("aria-label", known ? label : `${label}${UNKNOWN}`);
}

function toggle(item, send) {
  const element = h("button", { class: "switch", role: "switch", "aria-checked": "false", "aria-label": item.label, onclick: () => {
    const wanted = element.getAttribute("aria-checked") === "true" ? "OFF" : "ON";
    send(wanted);
  } }, h("span", { class: "knob" }));
  return { element, hides: true, known: naming(element), show: (state) => element.setAttribute("aria-checked", state === "ON" ? "true" : "false") };
}

function slider(item, send) {
  const { min, max, step } = { min: 0, max: 100, step: 1, ...(item.range ?? {}) };
  let held = false;
  const element = h("input", { type: "range", min, max, step: step ?? 1, value: min, "aria-label": item.label,
    oninput: () => { held = true; },
    onchange: () => {
      held = false;
      const wanted = element.value;
      send(wanted, (state) => Math.abs(number(state) - number(wanted)) < 0.5);
    } });
  return { element, known: naming(element), show(state) {
    if (!held) element.value = Number.isNaN(number(state)) ? min : number(state);
  } };
}

function stepper(item, send) {
  const { min, max, step } = { min: -Infinity, max: Infinity, step: 1, ...(item.range ?? {}) };
  let now = Number.NaN;
  const by = (sign) => {
    if (Number.isNaN(now)) return;
    now = Math.min(max, Math.max(min, Math.round((now + sign * (step ?? 1)) * 1000) / 1000));
    const wanted = now;
    send(item.unit ? `${wanted} ${item.unit}` : `${wanted}`, (state) => Math.abs(number(state) - wanted) < 0.001);
  };
  const element = h("span", { class: "buttons" },
    h("button", { onclick: () => by(-1), "aria-label": `${item.label}: less` }, icon("less")),
    h("button", { onclick: () => by(1), "aria-label": `${item.label}: more` }, icon("more")));
  return { element, show: (state) => { now = number(state); } };
}

function shutter(item, send) {
  const ends = { UP: 0, DOWN: 100 };
  let now = Number.NaN;
  const button = (command, label) => h("button", { onclick: () => send(command, now === (ends[command] ?? now) ? null : () => true), "aria-label": `${item.label}: ${label}` }, icon(label));
  const element = h("span", { class: "buttons" }, button("UP", "up"), button("STOP", "stop"), button("DOWN", "down"));
  return { element, show: (state) => { now = number(state); } };
}

function player(item, send) {
  const play = h("button", { "aria-label": `${item.label}: play or pause`, onclick: () => send(playing ? "PAUSE" : "PLAY") }, icon("play"));
  let playing = false;
  const skip = (command, label) => h("button", { onclick: () => send(command, null), "aria-label": `${item.label}: ${label}` }, icon(label));
  const element = h("span", { class: "buttons" }, skip("PREVIOUS", "previous"), play, skip("NEXT", "next"));
  return { element, hides: true, known: naming(play), show(state) {
    playing = state === "PLAY";
    play.replaceChildren(icon(playing ? "pause" : "play"));
  } };
}

function choice(item, send) {
  const element = h("select", { "aria-label": item.label, onchange: () => send(element.value) },
    h("option", { value: "", disabled: true, selected: true }, "–"),
    Object.entries(item.options).map(([state, label]) => h("option", { value: state }, label)));
  return { element, tells: true, show: (state) => { element.value = state in item.options ? state : ""; } };
}

function colour(item, send) {
  const element = h("input", { type: "color", "aria-label": item.label, onchange: () => {
    const wanted = toHsb(element.value);
    send(wanted.join(","), (state) => close(state.split(",").map(Number), wanted));
  } });
  const off = h("button", { onclick: () => send("OFF", (state) => number(state.split(",")[2]) === 0) }, "Off");
  off.setAttribute("aria-label", `${item.label}: off`);
  return { element: h("span", { class: "buttons" }, element, off), hides: true, known: naming(element), show(state) {
    const parts = state.split(",").map(Number);
    element.value = parts.length === 3 && !parts.some(Number.isNaN) ? toRgb(parts) : "#000000";
  } };
}

const close = (one, other) => one.length === 3 && one.every((value, index) => Math.abs(value - other[index]) <= 1.5);

function toHsb(rgb) {
  const [r, g, b] = [1, 3, 5].map((at) => Number.parseInt(rgb.slice(at, at + 2), 16) / 255);
  const top = Math.max(r, g, b), span = top - Math.min(r, g, b);
  let hue = 0;
  if (span) hue = top === r ? ((g - b) / span + 6) % 6 : top === g ? (b - r) / span + 2 : (r - g) / span + 4;
  return [Math.round(hue * 60) % 360, Math.round(top ? (span / top) * 100 : 0), Math.round(top * 100)];
}

function toRgb([hue, saturation, brightness]) {
  const part = (n) => {
    const k = (n + hue / 60) % 6;
    const value = (brightness / 100) * (1 - (saturation / 100) * Math.max(0, Math.min(k, 4 - k, 1)));
    return Math.round(value * 255).toString(16).padStart(2, "0");
  };
  return `#${part(5)}${part(3)}${part(1)}`;
}

const CONTROLS = {
  Switch: toggle, Dimmer: slider, Rollershutter: shutter, Player: player, Color: colour,
  Number: (item, send) => (Object.keys(item.options).length ? choice(item, send) : stepper(item, send)),
};
