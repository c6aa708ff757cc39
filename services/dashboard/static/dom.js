// Making elements, icons and the texts that people read. Not here: what they show (views/).

const SVG = "http://www.w3.org/2000/svg";

function fill(element, properties, children) {
  for (const [name, value] of Object.entries(properties ?? {})) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.setAttribute("class", value);
    else if (name === "value") element.value = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

/** An element: `h("button", {class: "quiet", onclick: f}, "Stop")`. */
export function h(tag, properties, ...children) {
  return fill(document.createElement(tag), properties, children);
}

/** The same for SVG. */
export function s(tag, properties, ...children) {
  return fill(document.createElementNS(SVG, tag), properties, children);
}

/** Sets a text only where it changed: thousands of values come every second. */
export function text(element, wanted) {
  if (element.firstChild?.nodeType === 3 && element.childNodes.length === 1) {
    if (element.firstChild.data !== wanted) element.firstChild.data = wanted;
  } else {
    element.textContent = wanted;
  }
}

const ICONS = {
  apartment: "M4 11.5 12 5l8 6.5M6.5 10v9h11v-9M10 19v-5h4v5",
  camera: "M4 8h11v9H4zM15 11l5-2.5v8L15 14",
  devices: "M9 18h6M10 21h4M12 3a6 6 0 0 0-3.5 10.9V16h7v-2.1A6 6 0 0 0 12 3z",
  history: "M4 19h16M4 15l4-5 4 3 4-7 4 5",
  missions: "M6 21V4l11 3.5L6 11",
  health: "M3 12h4l2-6 4 12 2.5-6H21",
  bus: "M4 7h16M4 12h16M4 17h16M8 4.5v5M15 9.5v5M10 14.5v5",
  light: "M9 18h6M10 21h4M12 3a6 6 0 0 0-3.5 10.9V16h7v-2.1A6 6 0 0 0 12 3z",
  colorlight: "M9 18h6M10 21h4M12 3a6 6 0 0 0-3.5 10.9V16h7v-2.1A6 6 0 0 0 12 3zM12 7v4",
  temperature: "M12 4a2 2 0 0 1 2 2v8a4 4 0 1 1-4 0V6a2 2 0 0 1 2-2zM12 10v6",
  heating: "M12 4a2 2 0 0 1 2 2v8a4 4 0 1 1-4 0V6a2 2 0 0 1 2-2zM18 6v4M16 8h4",
  humidity: "M12 4c4 5 6 7.5 6 10.5a6 6 0 0 1-12 0C6 11.5 8 9 12 4z",
  energy: "M13 3 6 13h5l-1 8 7-10h-5z",
  poweroutlet: "M5 5h14v14H5zM9.5 10v3M14.5 10v3",
  motion: "M12 5.5a1.5 1.5 0 1 0 .01 0M8 12l4-3 4 3M12 9v6l-3 5M12 15l3 5",
  door: "M7 20V4h10v16M5 20h14M14 12h.01",
  time: "M12 4a8 8 0 1 0 .01 0M12 8v4l3 2",
  player: "M8 5v14l11-7z",
  soundvolume: "M5 10v4h3l4 4V6l-4 4zM16 9a4 4 0 0 1 0 6M18.5 6.5a8 8 0 0 1 0 11",
  rollershutter: "M5 4h14v16H5zM5 8h14M5 12h14M5 16h14",
  climate: "M12 3v18M4.5 7.5l15 9M19.5 7.5l-15 9",
  robot: "M7 9h10v9H7zM12 9V5M9.5 13h.01M14.5 13h.01M4 12v4M20 12v4",
  network: "M12 4v5M6 15v-3h12v3M4 15h4v4H4zM16 15h4v4h-4zM10 15h4v4h-4zM12 9v6",
  theme: "M12 4a8 8 0 1 0 .01 0M12 4v16a8 8 0 0 0 0-16",
  leave: "M14 5H6v14h8M11 12h9M17 9l3 3-3 3",
  play: "M8 5v14l11-7z",
  pause: "M8 5v14M16 5v14",
  next: "M6 6v12l8-6zM17 6v12",
  previous: "M18 6v12l-8-6zM7 6v12",
  up: "M6 15l6-6 6 6",
  down: "M6 9l6 6 6-6",
  stop: "M7 7h10v10H7z",
  left: "M15 6l-6 6 6 6",
  right: "M9 6l6 6-6 6",
  less: "M6 12h12",
  more: "M6 12h12M12 6v12",
  other: "M12 8a4 4 0 1 0 .01 0",
};

/** A small drawing; it says nothing to who cannot see it. */
export function icon(name) {
  return s("svg", { viewBox: "0 0 24 24", class: "icon", "aria-hidden": "true" }, s("path", { d: ICONS[name] ?? ICONS.other }));
}

/** Items' states as people say them. */
export const WORDS = { ON: "On", OFF: "Off", OPEN: "Open", CLOSED: "Closed", PLAY: "Playing", PAUSE: "Paused", NULL: "–", UNDEF: "–" };

/** How long ago, roughly. */
export function ago(ms, now = Date.now()) {
  const seconds = Math.max(0, (now - ms) / 1000);
  if (seconds < 5) return "now";
  if (seconds < 90) return `${Math.round(seconds)} s ago`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min ago`;
  if (seconds < 129600) return `${Math.round(seconds / 3600)} h ago`;
  return `${Math.round(seconds / 86400)} days ago`;
}

/** Hours, minutes and seconds, as the page's reader has them. */
export function clock(ms) {
  return new Date(ms).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit", hour12: false });
}

/** The same again takes the place of the one before: a joystick gives three orders a second. */
export function toast(message, kind = "info") {
  const shown = h("p", { class: `toast ${kind}` }, message);
  const all = document.getElementById("toasts");
  for (const one of [...all.children]) if (one.textContent === message) one.remove();
  all.append(shown);
  setTimeout(() => shown.remove(), kind === "bad" ? 8000 : 4000);
}

/** A heading, and what stands beside it. */
export function head(title, ...beside) {
  return h("header", { class: "head" }, h("h1", { tabindex: "-1" }, title), h("div", { class: "beside" }, beside));
}

/** A small word with a colour. */
export function badge(word, kind = "") {
  return h("span", { class: `badge ${kind}` }, word);
}
