// Every topic that the dashboard may read, live, with a filter; and a box to say something.

import * as api from "../api.js";
import { badge, clock, h, head, text, toast } from "../dom.js";
import * as live from "../live.js";

export const topics = ["#"];

const ROW_PX = 30;
const DRAW_MS = 250;
const LATE = 12; // rows drawn beyond what is seen
const KINDS = { s: "state", e: "event", c: "command", b: "blob" };

export function show(root, { may }) {
  const filter = h("input", { type: "search", placeholder: "Filter: camera/#", "aria-label": "Filter topics", oninput: () => draw() });
  const stopped = h("input", { type: "checkbox", id: "hold", onchange: () => draw() });
  const count = badge("");
  const rows = h("div", { class: "rows", role: "rowgroup" });
  const inside = h("div", { class: "inside", role: "presentation" }, rows);
  const list = h("div", { class: "topics", tabindex: "0", role: "table", "aria-label": "Topics", onscroll: () => draw(true) }, inside);
  const detail = h("pre", { class: "payload", tabindex: "0", "aria-label": "Payload" }, "Choose a topic.");
  const chosenName = h("h2", {}, "Payload");
  let chosen = null;
  let held = null;
  root.append(
    head("Bus", count, h("label", { class: "inline", for: "hold" }, stopped, "Hold"), filter),
    h("div", { class: "columns wide" },
      h("section", { class: "panel flush" }, list),
      h("div", { class: "stack" }, h("section", { class: "panel" }, chosenName, detail), may ? publishBox() : null)));

  function fitting() {
    const words = filter.value.trim();
    const isFilter = /[+#]/.test(words);
    const matches = isFilter ? live.matcher(words) : (topic) => topic.includes(words);
    return live.all("#").filter((entry) => matches(entry.topic)).sort((one, other) => (one.topic < other.topic ? -1 : 1));
  }

  function draw(scrolled = false) {
    if (!scrolled && !stopped.checked) held = null;
    if (!scrolled || !held) held = stopped.checked && held ? held : fitting();
    text(count, `${held.length} topics`);
    inside.style.height = `${held.length * ROW_PX}px`;
    const first = Math.max(0, Math.floor(list.scrollTop / ROW_PX) - LATE);
    const last = Math.min(held.length, Math.ceil((list.scrollTop + list.clientHeight) / ROW_PX) + LATE);
    rows.style.transform = `translateY(${first * ROW_PX}px)`;
    while (rows.children.length > last - first) rows.lastChild.remove();
    while (rows.children.length < last - first) rows.append(row());
    held.slice(first, last).forEach((entry, index) => fillRow(rows.children[index], entry));
    if (chosen && live.get(chosen)) tell(live.get(chosen));
  }

  function row() {
    const made = h("div", { class: "topic", role: "row" },
      h("button", { class: "name", role: "cell", onclick: () => { chosen = made.dataset.topic; draw(); } }),
      h("span", { class: "text", role: "cell" }), h("span", { class: "kind", role: "cell" }), h("span", { class: "when", role: "cell" }));
    return made;
  }

  function fillRow(made, entry) {
    made.dataset.topic = entry.topic;
    made.classList.toggle("chosen", entry.topic === chosen);
    const [name, said, kind, when] = made.children;
    text(name, entry.topic);
    text(said, entry.text.slice(0, 200));
    text(kind, KINDS[entry.kind] === "state" ? "retained" : KINDS[entry.kind]);
    text(when, clock(entry.at));
  }

  function tell(entry) {
    text(chosenName, entry.topic);
    const value = entry.json;
    text(detail, value !== null && typeof value === "object" ? JSON.stringify(value, null, 2) : entry.text);
  }

  let due = false;
  const stop = live.batches(() => {
    if (due || stopped.checked) return;
    due = true;
    setTimeout(() => { due = false; if (root.contains(list)) draw(); }, DRAW_MS);
  });
  const resize = () => draw(true);
  window.addEventListener("resize", resize);
  draw();
  return () => {
    stop();
    window.removeEventListener("resize", resize);
  };
}

function publishBox() {
  const topic = h("input", { id: "topic", name: "topic", required: true, placeholder: "home/Kitchen_Light/command", autocomplete: "off" });
  const payload = h("textarea", { id: "payload", name: "payload", rows: 3, placeholder: "ON" });
  const submit = async (event) => {
    event.preventDefault();
    if (await api.order("/api/publish", { topic: topic.value.trim(), payload: payload.value })) toast(`Said on ${topic.value}`);
  };
  return h("section", { class: "panel" }, h("h2", {}, "Say something"),
    h("form", { class: "form", onsubmit: submit }, h("label", { for: "topic" }, "Topic"), topic, h("label", { for: "payload" }, "Payload"), payload,
      h("p", { class: "hint" }, "The topic's kind decides whether it is retained."), h("button", { class: "main", type: "submit" }, "Publish")));
}
