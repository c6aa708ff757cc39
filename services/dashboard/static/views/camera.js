// A camera: its picture, turning it by click, joystick and place, its orders, its scan, its sound.

import { ago, badge, clock, h, head, icon, text } from "../dom.js";
import { give } from "../given.js";
import * as live from "../live.js";
import { joystick } from "./joystick.js";
import { video } from "./video.js";

export const topics = ["camera/#", "/dashboard/thumbnails/+", "/dashboard/video/+"];

const LOGGED = 8;
const MODES = { auto: "Automatic", color: "Colour", bw: "Black and white", scan: "For scans" };
const ENDS = { idle: "Nothing was looked for yet", done: "Done", cancelled: "Cancelled", failed: "Failed" };
const KINDS = { online: "good", degraded: "warn" };

export function show(root, context) {
  const names = context.apartment.cameras.map((camera) => camera.name);
  const stage = h("div", { class: "stage" });
  let close = () => {};
  const choose = (name) => {
    close();
    localStorage.setItem("camera", name);
    close = one(stage, context.apartment.cameras.find((camera) => camera.name === name), context.may, state);
  };
  const state = h("span", { class: "row" });
  const kept = names.includes(localStorage.getItem("camera")) ? localStorage.getItem("camera") : names[0];
  const pick = names.length > 1 ? h("select", { "aria-label": "Camera", onchange: () => choose(pick.value) }, names.map((name) => h("option", { value: name }, name))) : null;
  if (pick) pick.value = kept;
  root.append(head("Camera", pick, state), stage);
  if (kept) choose(kept);
  else stage.append(h("p", { class: "empty" }, "No camera is configured."));
  return () => close();
}

function one(stage, camera, may, state) {
  const name = camera.name;
  const service = `camera-${name}`;
  const at = (rest) => `camera/${name}/${rest}`;
  const order = (key, value) => give(key === "Goto" ? `${key} ${value}` : key, service, `/api/cameras/${name}/orders/${key}`, { value });
  const picture = video(name, may && camera.lens && camera.mount ? (right, down) => give("Centre", service, `/api/cameras/${name}/centre`, { right, down }) : null);
  const where = h("dl", { class: "where" });
  const streaming = h("button", { onclick: () => order("RTSP", streaming.getAttribute("aria-pressed") !== "true"), "aria-pressed": "false" }, "Live picture");
  const stops = [];
  const parts = [places(name, may, order, stops), may ? controls(order, stops) : null, scan(camera, may, order, stops), may ? looks(name, order, stops) : null, may ? sound(name, order, stops) : null, log(name, stops)];
  stage.replaceChildren(h("div", { class: "columns camera" },
    h("div", { class: "stack" },
      h("section", { class: "panel flush" }, picture.element, h("div", { class: "below" }, where, may ? streaming : null)),
      parts[0]),
    h("div", { class: "stack" }, parts.slice(1))));

  const fares = () => {
    const told = live.get(at("status"))?.json;
    stage.classList.toggle("old", live.gone(service));
    if (live.gone(service)) state.replaceChildren(badge("service offline", "bad"), h("span", { class: "hint" }, "What is shown is from before"));
    else if (told) state.replaceChildren(badge(told.state, KINDS[told.state] ?? "bad"), h("span", { class: "hint" }, told.reason));
    else state.replaceChildren(h("span", { class: "hint" }, "Its service has said nothing yet"));
  };
  fares();
  const line = (label, value) => h("div", {}, h("dt", {}, label), h("dd", {}, value));
  stops.push(
    live.values(at("position"), ({ json }) => where.replaceChildren(line("Pan", `${json.pan.toFixed(1)}°`), line("Tilt", `${json.tilt.toFixed(1)}°`), line("Zoom", `${json.zoom}`), line("Place", json.moving ? "moving …" : (json.place ?? "–")))),
    live.watch(at("status"), fares),
    live.watch(`service/${service}/status`, fares),
    live.values(at("stream"), ({ json }) => {
      streaming.setAttribute("aria-pressed", `${json.rtsp}`);
      text(streaming, json.rtsp ? "Live picture: on" : "Live picture: off");
      picture.show(json.rtsp);
    }),
  );
  return () => {
    for (const stop of stops) stop();
    picture.close();
    stage.replaceChildren();
    stage.classList.remove("old");
  };
}

const panel = (title, ...children) => h("section", { class: "panel" }, h("h2", {}, title), children);

function controls(order, stops) {
  const stick = joystick((direction, speed, seconds) => order("Move", `${direction} ${speed} ${seconds}`), () => order("Move", "Stop"));
  stops.push(() => stick.close());
  const zoom = (way, drawing) => h("button", { onclick: () => order("Zoom", way), "aria-label": `Zoom ${way.toLowerCase()}` }, icon(drawing));
  return panel("Turn", h("div", { class: "turn" }, stick.element, h("div", { class: "zoom" }, zoom("In", "more"), h("span", { class: "hint" }, "Zoom"), zoom("Out", "less"))));
}

function places(name, may, order, stops) {
  const list = h("ul", { class: "places" });
  const fresh = h("input", { id: "place", maxlength: 80, required: true, placeholder: "New place", "aria-label": "Name of the new place" });
  const save = async (event) => {
    event.preventDefault();
    if (await order("SaveAs", fresh.value)) fresh.value = "";
  };
  const draw = () => {
    const known = live.get(`camera/${name}/places`)?.json ?? {};
    const here = live.get(`camera/${name}/position`)?.json?.place;
    const pictures = live.get(`/dashboard/thumbnails/${name}`)?.json ?? {};
    const wanted = JSON.stringify([Object.keys(known), here, pictures]);
    if (list.dataset.shown === wanted) return;
    list.dataset.shown = wanted;
    list.replaceChildren(...Object.keys(known).map((place) => {
      const source = `/api/cameras/${name}/places/${encodeURIComponent(place)}/thumbnail.jpg?${pictures[place]}`;
      return h("li", {}, h("button", { onclick: () => order("Goto", place), disabled: !may, "aria-current": place === here ? "true" : null },
        pictures[place] ? h("img", { src: source, alt: "", loading: "lazy" }) : h("span", { class: "blank" }, icon("camera")), h("span", {}, place)));
    }));
    if (!list.children.length) list.append(h("li", { class: "hint" }, "None saved yet"));
  };
  draw();
  stops.push(live.watch(`camera/${name}/places`, draw), live.watch(`camera/${name}/position`, draw), live.watch(`/dashboard/thumbnails/${name}`, draw));
  const remove = h("button", { class: "quiet", type: "button", onclick: () => {
    const here = live.get(`camera/${name}/position`)?.json?.place;
    if (here && confirm(`Forget the place ${here}?`)) order("Remove", here);
  } }, "Forget this place");
  return panel("Places", list, may ? h("form", { class: "row", onsubmit: save }, fresh, h("button", { type: "submit" }, "Save here"), remove) : null);
}

function scan(camera, may, order, stops) {
  const { name } = camera;
  const targets = h("input", { id: "targets", value: camera.targets.join(", "), size: 12, inputmode: "numeric", placeholder: "582, 17" });
  const bar = h("progress", { max: 1, value: 0, "aria-label": "Progress of the scan" });
  const said = h("p", { class: "hint" });
  const start = h("button", { class: "main", onclick: () => order("Scan", { targets: targets.value.split(/[^0-9]+/).filter(Boolean).map(Number) }) }, "Scan");
  const cancel = h("button", { onclick: () => order("Scan", false) }, "Cancel");
  const found = h("ul", { class: "found" });
  const fares = () => {
    const json = live.get(`camera/${name}/scan/state`)?.json;
    if (!json) return;
    const running = json.state === "running" && !live.gone(`camera-${name}`);
    bar.value = running || json.state === "done" ? json.progress : 0;
    cancel.disabled = !running;
    const turn = json.turn > 1 ? `, turn ${json.turn}` : "";
    text(said, running ? `Looking from ${json.place ?? "…"}${turn}: ${json.frames_analysed} pictures, ${Math.round(json.elapsed_s)} s` : `${ENDS[json.state] ?? "It ended with its service"}${json.reason ? `: ${json.reason}` : ""}${json.state === "done" ? ` in ${Math.round(json.elapsed_s)} s, found ${json.found.join(", ") || "nothing"}` : ""}`);
  };
  stops.push(live.watch(`camera/${name}/scan/state`, fares), live.watch(`service/camera-${name}/status`, fares));
  const draw = () => found.replaceChildren(...live.all(`camera/${name}/marker/+`).map(({ json }) => {
    const p = json.position;
    const sigma = json.covariance ? Math.sqrt(Math.max(json.covariance[0][0], json.covariance[1][1], json.covariance[2][2])) : null;
    return h("li", {}, h("strong", {}, `${json.marker}`), h("span", {}, `from ${json.place}`, h("span", { class: "hint" }, ` ${ago(Date.parse(json.stamp), live.now())}`)),
      h("span", { class: "number" }, p ? `${p.x.toFixed(2)}, ${p.y.toFixed(2)}, ${p.z.toFixed(2)} m${sigma ? ` ± ${(sigma * 1000).toFixed(0)} mm` : ""}` : json.why));
  }));
  stops.push(live.watch(`camera/${name}/marker/+`, draw));
  return panel("Scan for markers", may ? h("div", { class: "row" }, h("label", { class: "inline", for: "targets" }, "Markers"), targets, start, cancel) : null, bar, said, found, analysed(name, may, order, stops));
}

/** What the scan looks at, the markers drawn into it; the next is fetched when the one before is there. */
function analysed(name, may, order, stops) {
  const image = h("img", { alt: "The picture that the scan analysed last, its markers drawn" });
  const caption = h("figcaption", { class: "hint" });
  const figure = h("figure", { class: "analysed", hidden: true }, image, caption);
  let [newest, loading] = [0, 0];
  const load = () => {
    if (loading || document.hidden) return;
    loading = newest;
    image.src = `/api/cameras/${name}/scan.jpg?${newest}`;
  };
  image.onload = () => {
    const shown = loading;
    loading = 0;
    figure.hidden = false;
    text(caption, `Analysed at ${clock(shown)}`);
    if (newest > shown) load();
  };
  image.onerror = () => { loading = 0; };
  stops.push(live.watch(`camera/${name}/scan/image`, ({ at }) => {
    newest = at;
    load();
  }));
  if (!may) return figure;
  const box = h("input", { type: "checkbox", id: "analysed", onchange: () => order("ScanImgPub", box.checked) });
  stops.push(ordered(name, "ScanImgPub", (value) => { box.checked = flag(value); }));
  return [h("label", { class: "inline tick", for: "analysed" }, box, "Show what it looks at"), figure];
}

/** Calls `take(value)` for each order of that key that was done: nothing else tells how some options stand. */
const ordered = (name, key, take) => live.values(`camera/${name}/order_result`, ({ json }) => json.key === key && json.state === "done" && take(json.value));
const flag = (value) => ["true", "on", "1"].includes(`${value}`.toLowerCase());

function looks(name, order, stops) {
  const pair = (key) => {
    const [on, off] = [true, false].map((value) => h("button", { onclick: () => order(key, value), "aria-label": `${key} ${value ? "on" : "off"}`, "aria-pressed": "false" }, value ? "On" : "Off"));
    stops.push(ordered(name, key, (value) => [on, off].forEach((one) => one.setAttribute("aria-pressed", `${(one === on) === flag(value)}`))));
    return h("div", { class: "pair-row" }, h("span", {}, key), h("span", { class: "buttons" }, on, off));
  };
  const mode = h("select", { "aria-label": "Video mode", onchange: () => order("VideoMode", mode.value) },
    h("option", { value: "", disabled: true, selected: true }, "Choose …"), Object.entries(MODES).map(([value, label]) => h("option", { value }, label)));
  stops.push(ordered(name, "VideoMode", (value) => { mode.value = value in MODES ? value : ""; }));
  return panel("Picture", pair("Privacy"), pair("Flip"), pair("Mirror"),
    h("div", { class: "pair-row" }, h("span", {}, "Video mode"), mode),
    h("div", { class: "row" }, h("a", { class: "button", href: `/api/cameras/${name}/snapshot.jpg`, download: `${name}.jpg` }, "Snapshot"),
      h("button", { class: "danger", onclick: () => confirm("Restart the camera? It is away for about a minute.") && order("Reboot", true) }, "Restart camera")));
}

function sound(name, order, stops) {
  const seconds = h("input", { id: "seconds", type: "number", min: 1, max: 600, value: "5" });
  const file = h("input", { id: "file", list: "files", placeholder: "hello.wav" });
  const files = h("datalist", { id: "files" });
  const heard = h("p", { class: "hint" });
  const known = new Set();
  stops.push(live.values(`camera/${name}/audio`, ({ json }) => {
    known.add(json.file);
    files.replaceChildren(...[...known].map((one) => h("option", { value: one })));
    text(heard, `Recorded ${json.file}, ${json.seconds.toFixed(1)} s`);
  }));
  return panel("Sound",
    h("div", { class: "row" }, h("label", { class: "inline", for: "seconds" }, "Seconds"), seconds, h("button", { onclick: () => order("AudioRec", seconds.value) }, "Record")),
    h("div", { class: "row" }, h("label", { class: "inline", for: "file" }, "File"), file, files, h("button", { onclick: () => file.value && order("AudioPlay", file.value) }, "Play")), heard);
}

function log(name, stops) {
  const list = h("ol", { class: "log" }, h("li", { class: "hint" }, "None yet"));
  const orders = new Map();
  stops.push(live.values(`camera/${name}/order_result`, ({ json, at }) => {
    orders.delete(json.id);
    orders.set(json.id, { json, at });
    const shown = [...orders.values()].filter((one) => one.json.key !== "Move" || one.json.error).slice(-LOGGED).reverse();
    list.replaceChildren(...shown.map((one) => h("li", {}, h("time", {}, clock(one.at)), h("span", {}, `${one.json.key} ${typeof one.json.value === "string" ? one.json.value : ""}`),
      badge(one.json.state, { done: "good", failed: "bad", refused: "bad" }[one.json.state] ?? ""), one.json.error ? h("span", { class: "hint" }, one.json.error) : null)));
  }));
  return panel("Orders", list);
}
