// The things of the home by room, live. A control shows that it waits until the item's state confirms.

import { badge, h, head, text } from "../dom.js";
import { card } from "./device.js";
import * as live from "../live.js";

export const topics = ["home/+/state"];

const OUTSIDE = "Elsewhere";

export function show(root, { apartment, may }) {
  const rooms = new Map(Object.entries(apartment.rooms).map(([name, label]) => [name, { label, items: [] }]));
  rooms.set(null, { label: OUTSIDE, items: [] });
  for (const [name, item] of Object.entries(apartment.items)) (rooms.get(item.room) ?? rooms.get(null)).items.push([name, item]);
  const search = h("input", { type: "search", placeholder: "Filter", "aria-label": "Filter devices", oninput: () => filter(search.value) });
  const cards = new Map();
  const count = badge("");
  const sections = [...rooms.values()].filter((room) => room.items.length).map((room) => {
    const made = room.items.map(([name, item]) => {
      const one = card(name, item, may);
      cards.set(name, one);
      return one.element;
    });
    return h("section", { class: "room" }, h("h2", {}, room.label), h("div", { class: "cards" }, made));
  });
  root.append(head("Devices", count, search), ...sections, h("p", { class: "empty", hidden: true }, "Nothing fits."));

  function filter(words) {
    const wanted = words.trim().toLowerCase();
    let shown = 0;
    for (const [name, one] of cards) {
      const fits = !wanted || `${name} ${one.label}`.toLowerCase().includes(wanted);
      one.element.hidden = !fits;
      shown += fits;
    }
    for (const section of sections) section.hidden = ![...section.querySelectorAll(".card")].some((one) => !one.hidden);
    root.querySelector(".empty").hidden = shown > 0;
    text(count, `${shown}`);
  }

  filter("");
  const stop = live.watch("home/+/state", (entry) => cards.get(entry.topic.split("/")[1])?.state(entry));
  return () => {
    stop();
    for (const one of cards.values()) one.close();
  };
}
