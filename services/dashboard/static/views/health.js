// How everything fares: components as a tree with the worst of each branch, services, and messages per second.

import { ago, badge, h, head, text } from "../dom.js";
import * as live from "../live.js";

export const topics = ["diagnostics/#", "service/+/info", "/dashboard/rates"];

const LEVELS = ["OK", "Warning", "Error", "Stale"];
const KINDS = ["good", "warn", "bad", "stale"];
const STALE_S = 5;
const KEPT = 60; // rates in the small plot
const DRAW_MS = 500;

export function show(root) {
  const worst = badge("");
  const tree = h("ul", { class: "tree", role: "tree", "aria-label": "Components" });
  const services = h("tbody");
  const rates = h("div", { class: "rates" });
  const open = new Set();
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
    tree.replaceChildren(...top.children.map((node) => item(node)));
    text(worst, LEVELS[top.level]);
    worst.className = `badge ${KINDS[top.level]}`;
  }

  function item(node) {
    const unfolds = node.children.length > 0 || Object.keys(node.values ?? {}).length > 0;
    const isOpen = open.has(node.path) || (node.children.length > 0 && !open.has(`-${node.path}`));
    const turn = () => {
      const was = row.getAttribute("aria-expanded") === "true";
      open.delete(was ? node.path : `-${node.path}`);
      open.add(was ? `-${node.path}` : node.path);
      drawTree();
      tree.querySelector(`[data-path="${CSS.escape(node.path)}"]`)?.focus();
    };
    const keys = (event) => {
      const rows = [...tree.querySelectorAll("[role=treeitem]")];
      const at = rows.indexOf(row);
      if (event.key === "ArrowDown") rows[at + 1]?.focus();
      else if (event.key === "ArrowUp") rows[at - 1]?.focus();
      else if (unfolds && (event.key === "Enter" || event.key === " " || event.key === (isOpen ? "ArrowLeft" : "ArrowRight"))) turn();
      else return;
      event.preventDefault();
      event.stopPropagation();
    };
    const row = h("li", { role: "treeitem", tabindex: "0", "data-path": node.path, "aria-expanded": unfolds ? `${isOpen}` : null, onkeydown: keys },
      h("div", { class: "line", onclick: unfolds ? turn : null },
        h("span", { class: "fold", "aria-hidden": "true" }, unfolds ? (isOpen ? "▾" : "▸") : ""),
        h("span", { class: `dot ${KINDS[node.level]}`, role: "img", "aria-label": LEVELS[node.level] }),
        h("span", { class: "name" }, node.name), h("span", { class: "said" }, node.message ?? "")));
    if (isOpen && unfolds) row.append(h("ul", { role: "group" }, node.children.map(item), values(node.values)));
    return row;
  }

  function values(found) {
    return Object.entries(found ?? {}).map(([name, value]) =>
      h("li", { class: "pair", role: "none" }, h("span", {}, name.replaceAll("_", " ")), h("span", {}, value)));
  }

  function drawServices() {
    const rows = live.all("service/+/status").sort((one, other) => one.topic.localeCompare(other.topic)).map((entry) => {
      const name = entry.topic.split("/")[1];
      const info = live.get(`service/${name}/info`)?.json;
      const counters = info?.counters ?? {};
      const kind = entry.text === "online" ? "good" : "bad";
      return h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, badge(entry.text, kind)),
        h("td", {}, info ? ago(Date.parse(info.started)) : ""), ...["received", "published", "bad"].map((key) => h("td", { class: "number" }, `${counters[key] ?? ""}`)));
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
    const focused = tree.contains(document.activeElement) ? document.activeElement : null;
    if (!focused?.matches(":focus-visible")) { // a screen reader would be told the same again and again
      drawTree();
      if (focused) tree.querySelector(`[data-path="${CSS.escape(focused.dataset.path)}"]`)?.focus();
    }
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
    const late = Date.now() - entry.at > STALE_S * 1000 && entry.fresh;
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
