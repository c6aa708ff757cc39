// Missions of the robots: sent, watched and cancelled here, those that were, and where a marker was last.

import * as api from "../api.js";
import { ago, badge, clock, h, head, text } from "../dom.js";
import { forget, give } from "../given.js";
import * as live from "../live.js";

export const topics = ["mission/#", "robot/+/goto/result"];

const SHOWN = 20;
const SERVICE = "mission";
const ENDS = { found: "good", not_found: "warn", failed: "bad", cancelled: "", refused: "bad" };
export const WORDS = { idle: "Waiting for orders", go: "On the way", look: "Looking", scan: "The house looks", found: "Found", not_found: "Not found", failed: "Failed", cancelled: "Cancelled", refused: "Refused" };

export function show(root, { apartment, may }) {
  root.append(head("Missions"));
  const closes = apartment.robots.map((robot) => one(root, robot.name, may));
  if (!apartment.robots.length) root.append(h("p", { class: "empty" }, "No robot is configured."));
  return () => {
    for (const close of closes) close();
    forget(SERVICE);
  };
}

function one(root, name, may) {
  const marker = h("input", { id: `marker-${name}`, type: "number", min: 0, max: 9999, required: true, value: "582" });
  const id = () => Number(marker.value);
  const changes = ({ topic, fresh }) => fresh && topic.startsWith(`mission/${name}/`); // a cancel has no id of its own
  const cancel = h("button", { class: "danger", type: "button", onclick: () => give("Cancel", SERVICE, `/api/missions/${name}/cancel`, {}, changes) }, "Cancel");
  const where = h("button", { onclick: () => give("Where was it last", SERVICE, `/api/missions/${name}/where`, { find: id() }), type: "button" }, "Where was it last?");
  const submit = (event) => {
    event.preventDefault();
    give(`Find ${id()}`, SERVICE, `/api/missions/${name}/find`, { find: id() });
  };
  const now = h("p", { class: "now" });
  const why = h("p", { class: "hint" }, "The mission service has said nothing yet.");
  const steps = h("ol", { class: "timeline" });
  const answer = h("ul", { class: "found" });
  const results = h("div", { class: "stack" });
  const missing = h("p", { class: "hint" });
  const form = may ? h("form", { class: "row", onsubmit: submit }, h("label", { class: "inline", for: marker.id }, "Marker"), marker, h("button", { class: "main", type: "submit" }, "Find"), cancel, where) : null;
  root.append(h("div", { class: "columns missions" },
    h("div", { class: "stack" }, h("section", { class: "panel", "data-robot": name }, h("h2", {}, name), form, now, why, steps), h("section", { class: "panel", hidden: true }, h("h2", {}, "Last seen"), answer)),
    h("section", { class: "panel" }, h("h2", {}, "Past missions"), missing, results)));
  const states = [];
  const past = new Map();
  let gone = false;
  const draw = () => {
    const open = new Set([...results.querySelectorAll("details[open]")].map((one) => one.dataset.mission));
    const newest = [...past.values()].sort((one, other) => Date.parse(other.stamp) - Date.parse(one.stamp)).slice(0, SHOWN);
    results.replaceChildren(...newest.map((result, index) => told(result, index === 0 || open.has(result.id))));
    if (!newest.length) results.append(h("p", { class: "empty" }, "None yet."));
  };
  const fares = () => {
    const json = live.get(`mission/${name}/state`)?.json;
    const away = live.gone(SERVICE);
    now.parentElement.classList.toggle("old", away);
    if (away) {
      text(now, "The mission service is offline");
      text(why, "What is shown is from before.");
    } else if (json) {
      text(now, `${WORDS[json.state] ?? json.state}${json.marker === null ? "" : `: marker ${json.marker}`}${json.place ? `, ${json.place}` : ""}`);
      text(why, [json.reason, json.waiting.length ? `${json.waiting.length} waiting` : ""].filter(Boolean).join(" · "));
    }
  };
  const stops = [
    live.watch(`service/${SERVICE}/status`, fares),
    live.values(`mission/${name}/state`, ({ json, at }) => {
      fares();
      cancel.disabled = json.id === null && !json.waiting.length;
      if (json.id === null) return;
      if (states.length && states.at(-1).id !== json.id) states.length = 0;
      const last = states.at(-1);
      if (!last || last.state !== json.state || last.place !== json.place || last.reason !== json.reason) states.push({ ...json, at });
      steps.replaceChildren(...states.map((step, index) => line(step.state, clock(step.at), step.reason || step.place, index === states.length - 1)));
    }),
    live.values(`mission/${name}/result`, ({ json }) => {
      past.set(json.id, json);
      draw();
      if (states.at(-1)?.id === json.id) states.length = 0;
    }),
    live.values(`mission/${name}/where/reply/+`, ({ json, fresh }) => {
      if (!fresh) return;
      answer.parentElement.hidden = false;
      answer.replaceChildren(...json.sightings.map((seen) => h("li", {}, h("strong", {}, `${json.marker}`), h("span", {}, `${seen.place ?? "somewhere"}, by ${seen.by}`, h("span", { class: "hint" }, ` ${ago(Date.parse(seen.stamp), live.now())}`)),
        h("span", { class: "number" }, seen.position ? `${seen.position.x.toFixed(2)}, ${seen.position.y.toFixed(2)} m` : "", seen.sigma_m ? ` ± ${(seen.sigma_m * 1000).toFixed(0)} mm` : ""))));
      if (!json.sightings.length) answer.append(h("li", {}, `Nobody has seen marker ${json.marker}`));
    }),
  ];
  draw();
  stored(name).then((found) => {
    if (gone) return;
    for (const result of found) if (!past.has(result.id)) past.set(result.id, result);
    draw();
  }).catch((error) => text(missing, `Only those since the dashboard was started: ${error.message}.`));
  return () => {
    gone = true;
    for (const stop of stops) stop();
  };
}

/** What the database has of them. */
const stored = async (name) => (await api.get(`/api/missions/${name}/past`)).missions;

const line = (state, when, why, current) => h("li", { class: current ? "current" : "", "data-state": state }, h("time", {}, when), h("span", {}, h("span", { class: "step" }, WORDS[state] ?? state), " ", h("span", { class: "hint" }, why)));

function told(result, open) {
  const total = Math.max(result.elapsed_s, 0.001);
  const bars = result.story.map((event, index) => {
    const share = (((result.story[index + 1]?.at_s ?? result.elapsed_s) - event.at_s) / total) * 100;
    const part = h("span", { "data-state": event.state, title: `${WORDS[event.state] ?? event.state}: ${event.text}` });
    part.style.flexGrow = Math.max(0.6, share);
    return part;
  });
  const position = result.position ? `${result.position.x.toFixed(2)}, ${result.position.y.toFixed(2)} m` : "";
  return h("details", { open, "data-mission": result.id }, h("summary", {}, h("strong", {}, `Marker ${result.marker}`), badge(WORDS[result.state] ?? result.state, ENDS[result.state]), h("span", { class: "hint" }, `${[result.place, position, result.by ? `by ${result.by}` : ""].filter(Boolean).join(" · ")}`), h("span", { class: "hint number" }, `${ago(Date.parse(result.stamp), live.now())} · ${Math.round(result.elapsed_s)} s`)),
    result.reason ? h("p", { class: "hint" }, result.reason) : null,
    h("div", { class: "bars", "aria-hidden": "true" }, bars),
    h("ol", { class: "timeline" }, result.story.map((event) => line(event.state, `${event.at_s.toFixed(0)} s`, event.text, false))));
}
