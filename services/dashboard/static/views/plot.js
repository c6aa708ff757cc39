// Plots of one unit each by uPlot (vendor/), and strips of states. Not here: what is plotted (history.js).

import { h, s, WORDS } from "../dom.js";

const HEIGHT = 240;
const COLOURS = ["--c1", "--c2", "--c3", "--c4", "--c5", "--c6"];

let loading = null;

function library() {
  loading ??= new Promise((ready, failed) => {
    document.head.append(h("link", { rel: "stylesheet", href: "/vendor/uPlot.min.css" }),
      h("script", { src: "/vendor/uPlot.iife.min.js", onload: () => ready(window.uPlot), onerror: () => failed(new Error("uPlot is missing")) }));
  });
  return loading;
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
export const colourOf = (index) => COLOURS[index % COLOURS.length];

/** A plot of series `{label, index, every, rows}` that share a unit; `zoom(since, until)` is called after a drag. */
export async function plot(place, unit, list, since, until, zoom) {
  const uPlot = await library();
  const tables = list.map((one) => gaps(one));
  const data = tables.length > 1 ? uPlot.join(tables) : tables[0];
  const series = [{}];
  const bands = [];
  const places = list.map((one) => decimals(one.rows));
  list.forEach((one, number) => {
    const line = colour(colourOf(one.index));
    const first = series.length;
    const quiet = { show: true, stroke: "transparent", points: { show: false }, label: "" };
    series.push({ ...quiet }, { ...quiet }, { label: one.label, stroke: line, width: 1.6, points: { show: one.rows.length < 60, size: 4 }, spanGaps: false, value: (_, v) => (v === null ? "–" : `${v.toFixed(places[number])} ${unit}`) });
    bands.push({ series: [first + 1, first], fill: `color-mix(in srgb, ${line} 18%, transparent)` });
  });
  const ink = { stroke: colour("--muted"), grid: { stroke: colour("--line"), width: 1 }, ticks: { stroke: colour("--line"), width: 1 }, font: "12px system-ui, sans-serif" };
  const options = {
    width: Math.max(260, place.clientWidth), height: HEIGHT, series, bands,
    axes: [{ ...ink, values: times }, { ...ink, size: 62, values: (_, ticks) => ticks.map((tick) => `${tick} ${unit}`) }],
    scales: { x: { time: true, range: () => [since, until] } },
    cursor: { drag: { x: true, y: false, setScale: false }, focus: { prox: 24 } },
    legend: { show: true, live: true },
    hooks: { setSelect: [(made) => {
      if (made.select.width > 4) zoom(made.posToVal(made.select.left, "x"), made.posToVal(made.select.left + made.select.width, "x"));
      made.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }] },
  };
  const made = new uPlot(options, data, place);
  made.root.querySelectorAll(".u-series").forEach((row, index) => { if (index > 0 && index % 3 !== 0) row.hidden = true; });
  const resize = new ResizeObserver(() => made.setSize({ width: Math.max(260, place.clientWidth), height: HEIGHT }));
  resize.observe(place);
  return () => {
    resize.disconnect();
    made.destroy();
  };
}

/** Columns time, least, greatest, mean; where rows are missing for long, a gap. */
function gaps({ rows, every }) {
  const columns = [[], [], [], []];
  let last = null;
  for (const [at, lo, mean, hi] of rows) {
    if (last !== null && at - last > Math.max(3 * every, 7200)) for (const [index, value] of [[0, last + every], [1, null], [2, null], [3, null]]) columns[index].push(value);
    for (const [index, value] of [[0, at], [1, lo], [2, hi], [3, mean]]) columns[index].push(value);
    last = at;
  }
  return columns;
}

function decimals(rows) {
  const span = Math.max(...rows.map((row) => row[3])) - Math.min(...rows.map((row) => row[1]));
  return span > 100 ? 0 : span > 10 ? 1 : 2;
}

function times(_, ticks, __, ___, step) {
  let day = "";
  return ticks.map((tick) => {
    const when = new Date(tick * 1000);
    const date = when.toLocaleDateString([], step > 86400 * 20 ? { month: "short", year: "2-digit" } : { day: "numeric", month: "short" });
    if (step >= 86400) return date;
    const hour = when.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: step < 60 ? "2-digit" : undefined, hour12: false });
    const shown = date === day ? hour : `${hour}\n${date}`;
    day = date;
    return shown;
  });
}

const WIDTH = 1000;
const STRONG = new Set(["ON", "OPEN", "PLAY", "UP"]);

/** A strip for each item whose states are words: when it was what. */
export function strip(series, { label, options }, since, until) {
  const word = (state) => options[state] ?? WORDS[state] ?? state;
  const at = (time) => ((Math.min(until, Math.max(since, time)) - since) / (until - since)) * WIDTH;
  const drawn = s("svg", { viewBox: `0 0 ${WIDTH} 22`, preserveAspectRatio: "none", role: "img", "aria-label": `${label}: ${series.rows.length} states` });
  const kinds = [...new Set(series.rows.map(([, state]) => state))];
  series.rows.forEach(([time, state], index) => {
    const end = series.rows[index + 1]?.[0] ?? Math.min(until, Date.now() / 1000);
    const kind = STRONG.has(state) ? "strong" : ["OFF", "CLOSED", "PAUSE", "NULL", "UNDEF"].includes(state) ? "weak" : `k${kinds.indexOf(state) % 4}`;
    if (end > since) drawn.append(s("rect", { x: at(time), y: 0, width: Math.max(0.7, at(end) - at(time)), height: 22, class: kind }, s("title", {}, `${word(state)}, ${new Date(time * 1000).toLocaleString()}`)));
  });
  return h("div", { class: "strip" }, h("span", {}, label), drawn, h("span", { class: "hint" }, series.rows.length ? word(series.rows.at(-1)[1]) : "–"));
}
