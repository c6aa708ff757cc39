// What was: any items over any span, plotted by unit; drag to zoom, and take it away as CSV.

import * as api from "../api.js";
import { h, head, toast } from "../dom.js";
import { colourOf, plot, strip } from "./plot.js";

export const topics = [];

const SPANS = { "1 h": 3600, "6 h": 21600, "24 h": 86400, "7 days": 604800, "30 days": 2592000, "1 year": 31536000 };
const MOST = 8;
const NUMBERS = new Set(["Number", "Dimmer", "Rollershutter"]);

export function show(root, { apartment }) {
  const stored = Object.entries(apartment.items).filter(([, item]) => item.stored && item.type !== "Location");
  const chosen = new Set(wanted(stored));
  const before = [];
  let [since, until] = [Date.now() / 1000 - 86400, Date.now() / 1000];
  let turn = 0;
  let closing = [];
  const plots = h("div", { class: "stack plots" });
  const back = h("button", { onclick: () => before.length && go(...before.pop(), false), disabled: true }, "Zoom out");
  const buttons = Object.entries(SPANS).map(([label, seconds]) => h("button", { "data-span": label, onclick: () => go(Date.now() / 1000 - seconds, Date.now() / 1000) }, label));
  const from = h("input", { type: "datetime-local", "aria-label": "From", onchange: () => typed() });
  const to = h("input", { type: "datetime-local", "aria-label": "To", onchange: () => typed() });
  const search = h("input", { type: "search", placeholder: "Filter", "aria-label": "Filter items", oninput: () => sift() });
  const boxes = stored.map(([name, item]) => {
    const box = h("input", { type: "checkbox", id: `item-${name}`, value: name, onchange: () => choose(name, box) });
    box.checked = chosen.has(name);
    const csv = h("a", { class: "csv", download: true, "aria-label": `${item.label} as CSV` }, "CSV");
    return { name, item, box, csv, row: h("li", {}, box, h("label", { for: `item-${name}` }, h("span", { class: "key" }), item.label), csv) };
  });
  root.append(head("History"),
    h("div", { class: "row spans" }, buttons, h("span", { class: "row dates" }, from, h("span", { class: "hint" }, "to"), to), back),
    h("div", { class: "columns history" }, h("section", { class: "panel" }, plots), h("section", { class: "panel items" }, h("h2", {}, "Items"), search, h("ul", {}, boxes.map((one) => one.row)))));

  function sift() {
    const words = search.value.trim().toLowerCase();
    for (const one of boxes) one.row.hidden = words !== "" && !`${one.name} ${one.item.label}`.toLowerCase().includes(words);
  }

  function choose(name, box) {
    if (box.checked && chosen.size >= MOST) {
      box.checked = false;
      toast(`At most ${MOST} at once`);
      return;
    }
    if (box.checked) chosen.add(name);
    else chosen.delete(name);
    draw();
  }

  function typed() {
    const [start, end] = [Date.parse(from.value) / 1000, Date.parse(to.value) / 1000];
    if (start < end) go(start, end);
  }

  function go(start, end, remember = true) {
    if (remember) before.push([since, until]);
    [since, until] = [start, end];
    draw();
  }

  function close() {
    for (const one of closing) one();
    closing = [];
  }

  async function draw() {
    const mine = ++turn;
    history.replaceState(null, "", `#/history/${[...chosen].join(",")}`);
    back.disabled = !before.length;
    from.value = local(since);
    to.value = local(until);
    for (const one of buttons) one.setAttribute("aria-pressed", Math.abs(until - since - SPANS[one.dataset.span]) < 2 && Math.abs(until - Date.now() / 1000) < 60 ? "true" : "false");
    const names = [...chosen];
    for (const one of boxes) {
      one.csv.href = `/api/history/${one.name}.csv?${query(1500)}`;
      one.row.classList.toggle("chosen", chosen.has(one.name));
      one.row.querySelector(".key").style.background = chosen.has(one.name) ? `var(${colourOf(names.indexOf(one.name))})` : "";
    }
    plots.setAttribute("aria-busy", "true");
    const width = Math.min(1500, Math.max(200, Math.round(plots.clientWidth || 800)));
    const found = await Promise.all(names.map((name) => api.get(`/api/history/${name}?${query(width)}`).catch((error) => ({ item: name, fault: error.message, rows: [] }))));
    if (mine !== turn) return;
    close();
    plots.replaceChildren();
    for (const one of found.filter((series) => series.fault)) plots.append(h("p", { class: "why" }, `${one.item}: ${one.fault}`));
    await drawNumbers(found.filter((one) => !one.fault && NUMBERS.has(apartment.items[one.item].type)), names, mine);
    if (mine !== turn) return;
    const states = found.filter((one) => !one.fault && !NUMBERS.has(apartment.items[one.item].type));
    plots.append(...states.map((one) => strip(one, apartment.items[one.item], since, until)));
    for (const one of states.filter((series) => series.known > series.since)) plots.append(h("p", { class: "why" }, `${apartment.items[one.item].label}: too much for one plot, shown from ${new Date(one.known * 1000).toLocaleString()} on`));
    if (!names.length) plots.append(h("p", { class: "empty" }, "Choose items to see what was."));
    plots.setAttribute("aria-busy", "false");
  }

  async function drawNumbers(list, names, mine) {
    const units = Map.groupBy ? Map.groupBy(list, unitOf) : grouped(list);
    for (const [unit, series] of units) {
      const some = series.filter((one) => one.rows.length);
      if (!some.length) {
        plots.append(h("p", { class: "empty" }, `Nothing was stored of ${series.map((one) => apartment.items[one.item].label).join(", ")} in this span.`));
        continue;
      }
      if (mine !== turn) return;
      const place = h("div", { class: "plot", role: "img", "aria-label": `Plot of ${some.map((one) => apartment.items[one.item].label).join(", ")}` });
      plots.append(place);
      const told = some.map((one) => ({ ...one, label: apartment.items[one.item].label, index: names.indexOf(one.item) }));
      const end = await plot(place, unit, told, since, until, (start, stop) => go(start, stop));
      if (mine !== turn) end();
      else closing.push(end);
    }
  }

  const unitOf = (one) => one.unit ?? apartment.items[one.item].unit ?? (apartment.items[one.item].type === "Number" ? "" : "%");
  function grouped(list) {
    const made = new Map();
    for (const one of list) made.set(unitOf(one), [...(made.get(unitOf(one)) ?? []), one]);
    return made;
  }

  const query = (points) => new URLSearchParams({ since: new Date(since * 1000).toISOString(), until: new Date(until * 1000).toISOString(), points });
  const repaint = () => draw();
  document.addEventListener("theme", repaint);
  draw();
  return () => {
    turn++;
    document.removeEventListener("theme", repaint);
    close();
  };
}

function wanted(stored) {
  const names = decodeURIComponent(location.hash.split("/")[2] ?? "").split(",").filter((name) => stored.some(([known]) => known === name));
  if (names.length) return names.slice(0, MOST);
  return stored.filter(([, item]) => item.icon === "temperature").slice(0, 3).map(([name]) => name);
}

function local(seconds) {
  const when = new Date(seconds * 1000);
  return new Date(when - when.getTimezoneOffset() * 60000).toISOString().slice(0, 16);
}
