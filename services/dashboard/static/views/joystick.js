// A pad that turns the camera while it is held, and stops it when it is let go: by pointer or by the arrow keys.
// Each order ends by itself within a second, so that a page that dies leaves no camera turning.

import { h, icon } from "../dom.js";

const AGAIN_MS = 300;
const LASTS_S = 0.8;
const DEAD = 0.18; // of the radius: no direction
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** `move(direction, speed, seconds)` turns, `stop()` stops. The result ends it. */
export function joystick(move, stop) {
  const knob = h("span", { class: "stick" });
  const pad = h("div", { class: "pad", tabindex: "0", role: "application", "aria-label": "Joystick: hold, or hold the arrow keys; letting go stops" },
    ["up", "right", "down", "left"].map((name) => h("span", { class: `hint-${name}` }, icon(name))), knob);
  const keys = new Set();
  let held = null;
  let timer = 0;
  let said = "";

  const say = () => {
    if (!held) return;
    said = `${held.direction} ${held.speed}`;
    move(held.direction, held.speed, LASTS_S);
  };

  function hold(x, y) {
    const far = Math.min(1, Math.hypot(x, y));
    knob.style.transform = `translate(${x * 38}px, ${y * 38}px)`;
    if (far < DEAD) return rest(false);
    held = { direction: direction(x, y), speed: Math.max(1, Math.round(far * 8)) };
    pad.classList.add("held");
    if (`${held.direction} ${held.speed}` !== said) say();
    if (!timer) timer = setInterval(say, AGAIN_MS);
  }

  function rest(centre = true) {
    clearInterval(timer);
    timer = 0;
    if (centre) knob.style.transform = "";
    pad.classList.remove("held");
    if (!held) return;
    held = null;
    said = "";
    stop();
  }

  const at = (event) => {
    const box = pad.getBoundingClientRect();
    hold(((event.clientX - box.left) / box.width) * 2 - 1, ((event.clientY - box.top) / box.height) * 2 - 1);
  };
  let pointer = null;
  pad.addEventListener("pointerdown", (event) => {
    pointer = event.pointerId;
    pad.setPointerCapture(pointer);
    at(event);
  });
  pad.addEventListener("pointermove", (event) => event.pointerId === pointer && at(event));
  const release = (event) => {
    if (event.pointerId !== pointer) return;
    pointer = null;
    rest();
  };
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) pad.addEventListener(name, release);

  const byKeys = () => {
    const [x, y] = [...keys].map((key) => KEYS[key]).reduce(([a, b], [c, d]) => [a + c, b + d], [0, 0]);
    if (x || y) hold(x * 0.5, y * 0.5);
    else rest();
  };
  pad.addEventListener("keydown", (event) => {
    if (!(event.key in KEYS)) return;
    event.preventDefault();
    if (!keys.has(event.key)) {
      keys.add(event.key);
      byKeys();
    }
  });
  pad.addEventListener("keyup", (event) => keys.delete(event.key) && byKeys());
  const away = () => {
    pointer = null;
    keys.clear();
    rest();
  };
  pad.addEventListener("blur", away);
  window.addEventListener("blur", away);
  const hidden = () => document.hidden && away();
  document.addEventListener("visibilitychange", hidden);
  return { element: pad, close() {
    away();
    window.removeEventListener("blur", away);
    document.removeEventListener("visibilitychange", hidden);
  } };
}

function direction(x, y) {
  const sector = Math.round(Math.atan2(y, x) / (Math.PI / 4)) & 7;
  return ["Right", "RightDown", "Down", "LeftDown", "Left", "LeftUp", "Up", "RightUp"][sector];
}
