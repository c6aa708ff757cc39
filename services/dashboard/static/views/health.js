// How everything fares: components as a tree with the worst of each branch, services, and messages per second.

import { ago, badge, h, head, text } from "../dom.js";
import * as live from "../live.js";

export const topics = ["diagnostics/#", "service/+/info", "/dashboard/rates"];

const LEVELS = ["OK", "Warning", "Error", "Stale"];
const KINDS = ["good", "warn", "bad", "stale"];
const STALE_S = 5; // everything tells how it fares once a second
const KEPT = 60; // rates in the small plot
const DRAW_MS = 500;

export function show(root) {
  const worst = badge("");
  const tree = h("ul", { class: "tree", role: "tree", "aria-label": "Components" });
  const services = h("tbody");
  const rates = h("div", { class: "rates" });
  const open = new Set();
  const rows = new Map(); // by path: a row stays the same element, so that whoever reads it by the keyboard stays there
  const history = new Map();
  root.append(
    head("Health", worst),
    h("div", { class: "columns" },
      h("section", { class: "panel" }, h("h2", {}, "Components"), tree),
      h("div", { class: "stack" },
        h("section", { class: "panel" }, h("h2", {}, "Messages per second"), rates),
        h("section", { class: "panel" }, h("h2", {}, "Services"),
          h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Services" }, h("table", { class: "services" }, h("thead", {}, h("tr", {},
            ["Service", "State", "Started", "Heard", "Said", "Refused"].map((title) => h("th", { scope: "col" }, title)))), services))))));

  function drawTree() {
    const top = branches(live.all("diagnostics/#"));
    arrange(tree, top.children.map(row));
    text(worst, LEVELS[top.level]);
    worst.className = `badge ${KINDS[top.level]}`;
  }

  /** The row of a component as it is now, and what is under it. */
  function row(node) {
    const made = rows.get(node.path) ?? item(node.path, node.name);
    rows.set(node.path, made);
    const { element, fold, dot, said, under } = made;
    const pairs = Object.entries(node.values ?? {});
    const unfolds = node.children.length > 0 || pairs.length > 0;
    const isOpen = unfolds && (open.has(node.path) || (node.children.length > 0 && !open.has(`-${node.path}`)));
    if (unfolds) element.setAttribute("aria-expanded", `${isOpen}`);
    else element.removeAttribute("aria-expanded");
    text(fold, unfolds ? (isOpen ? "▾" : "▸") : "");
    dot.className = `dot ${KINDS[node.level]}`;
    dot.setAttribute("aria-label", LEVELS[node.level]);
    text(said, node.message ?? "");
    under.hidden = !isOpen;
    arrange(under, isOpen ? [...node.children.map(row), ...pairs.map(([name, value]) => pair(made.pairs, name, value))] : []);
    return element;
  }

  function item(path, name) {
    const turn = () => {
      const was = element.getAttribute("aria-expanded") === "true";
      open.delete(was ? path : `-${path}`);
      open.add(was ? `-${path}` : path);
      drawTree();
      element.focus();
    };
    const keys = (event) => {
      const all = [...tree.querySelectorAll("[role=treeitem]")];
      const at = all.indexOf(element);
      const expanded = element.getAttribute("aria-expanded");
      if (event.key === "ArrowDown") all[at + 1]?.focus();
      else if (event.key === "ArrowUp") all[at - 1]?.focus();
      else if (expanded && (event.key === "Enter" || event.key === " " || event.key === (expanded === "true" ? "ArrowLeft" : "ArrowRight"))) turn();
      else return;
      event.preventDefault();
      event.stopPropagation();
    };
    const fold = h("span", { class: "fold", "aria-hidden": "true" });
    const dot = h("span", { role: "img" });
    const said = h("span", { class: "said" });
    const under = h("ul", { role: "group" });
    const line = h("div", { class: "line", onclick: () => element.hasAttribute("aria-expanded") && turn() }, fold, dot, h("span", { class: "name" }, name), said);
    const element = h("li", { role: "treeitem", tabindex: "0", "data-path": path, onkeydown: keys }, line, under);
    return { element, fold, dot, said, under, pairs: new Map() };
  }

  function drawServices() {
    const rows = live.all("service/+/status").sort((one, other) => one.topic.localeCompare(other.topic)).map((entry) => {
      const name = entry.topic.split("/")[1];
      const info = live.get(`service/${name}/info`)?.json;
      const counters = info?.counters ?? {};
      const kind = entry.text === "online" ? "good" : "bad";
      return h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, badge(entry.text, kind)),
        h("td", {}, info ? ago(Date.parse(info.started), live.now()) : ""), ...["received", "published", "bad"].map((key) => h("td", { class: "number" }, `${counters[key] ?? ""}`)));
    });
    services.replaceChildren(...rows);
  }

  const noteRates = (entry) => {
    for (const [level, rate] of Object.entries(entry.json ?? {})) {
      const kept = history.get(level) ?? [];
      kept.push(rate);
      history.set(level, kept.slice(-KEPT));
    }
    rates.replaceChildren(...[...history].map(([level, kept]) => h("div", { class: "rate" }, h("span", {}, level), spark(kept), h("span", { class: "number" }, kept.at(-1).toFixed(1)))));
  };

  const draw = () => {
    drawTree();
    drawServices();
  };
  draw();
  const timer = setInterval(draw, DRAW_MS * 2);
  const first = setTimeout(draw, DRAW_MS);
  const stops = [live.watch("/dashboard/rates", noteRates), live.watch("service/+/status", () => drawServices())];
  return () => {
    clearInterval(timer);
    clearTimeout(first);
    for (const stop of stops) stop();
  };
}

/** Makes these the children, in this order. Those that stay are not taken out, which would take the focus from them. */
function arrange(list, wanted) {
  const stays = new Set(wanted);
  for (const child of [...list.children]) if (!stays.has(child)) child.remove();
  wanted.forEach((child, index) => { if (list.children[index] !== child) list.insertBefore(child, list.children[index] ?? null); });
}

/** One of the values of a component; `known` are the lines that it has already. */
function pair(known, name, value) {
  const line = known.get(name) ?? h("li", { class: "pair", role: "none" }, h("span", {}, name.replaceAll("_", " ")), h("span"));
  known.set(name, line);
  text(line.lastChild, value);
  return line;
}

function branches(entries) {
  const top = { name: "", path: "", children: [], level: 0 };
  for (const entry of entries.sort((one, other) => one.topic.localeCompare(other.topic))) {
    let node = top;
    for (const name of entry.topic.split("/").slice(1)) {
      const path = `${node.path}/${name}`;
      let next = node.children.find((child) => child.name === name);
      if (!next) node.children.push((next = { name, path, children: [], level: 0 }));
      node = next;
    }
    const late = live.now() - entry.at > STALE_S * 1000;
    node.level = late ? 3 : (entry.json?.level ?? 3);
    node.message = entry.json?.message;
    node.values = entry.json?.values;
  }
  return gathered(top);
}

function gathered(node) {
  for (const child of node.children) node.level = Math.max(node.level, gathered(child).level);
  return node;
}

function spark(values) {
  const canvas = h("canvas", { width: 120, height: 24, "aria-hidden": "true" });
  const pen = canvas.getContext("2d");
  const most = Math.max(1, ...values);
  pen.strokeStyle = getComputedStyle(document.documentElement).getPropertyValue("--accent");
  pen.lineWidth = 1.5;
  pen.beginPath();
  values.forEach((value, index) => pen.lineTo((index / (KEPT - 1)) * 118 + 1, 22 - (value / most) * 20));
  pen.stroke();
  return canvas;
}
