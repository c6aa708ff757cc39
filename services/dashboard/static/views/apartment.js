// The plan: rooms, what stands in them, devices, where each camera looks, markers that were found, robots and their way.

import { ago, badge, clock, h, head, icon, s, text } from "../dom.js";
import { forget, give } from "../given.js";
import * as live from "../live.js";
import { NOTHING } from "./device.js";
import { looking, place, rad, round } from "./looking.js";
import { WORDS } from "./missions.js";

export const topics = ["home/+/state", "camera/+/position", "camera/+/status", "camera/+/marker/+", "camera/+/scan/state", "robot/+/pose", "mission/+/state"];

const HOME = "openhab"; // who answers a command by the item's state
const MARGIN = 0.35;
const TRAIL = 240;
const SIGMAS = 2;
const SILENT_S = 10; // a robot that has not said for so long where it is is away, as for the mission

export function show(root, { apartment, may }) {
  const plan = apartment.plan;
  const box = bounds(plan, apartment);
  const map = (x, y) => [round(x - box.left), round(box.top - y)];
  const points = (list) => list.map(([x, y]) => map(x, y).join()).join(" ");
  const layers = Object.fromEntries(["maps", "rooms", "furniture", "views", "walls", "things", "markers", "trails", "robots"].map((name) => [name, s("g", { class: name })]));
  const drawing = s("svg", { class: "plan", viewBox: `0 0 ${round(box.right - box.left)} ${round(box.top - box.bottom)}`, role: "group", "aria-label": "Plan of the apartment" });
  const clip = s("clipPath", { id: "inside" });
  drawing.append(s("defs", {}, clip), ...Object.values(layers));
  const side = { cameras: h("div"), robots: h("div"), markers: h("ul", { class: "found" }) };
  root.append(head("Apartment"), h("div", { class: "columns plan-columns" },
    h("section", { class: "panel plan-panel" }, drawing),
    h("div", { class: "stack" }, section("Camera", side.cameras), section("Robot", side.robots), section("Markers", side.markers))));

  const rooms = new Map();
  for (const [name, corners] of Object.entries(plan.rooms)) {
    const shape = s("polygon", { points: points(corners), class: "room-shape" });
    const air = s("tspan", { class: "air" });
    const [x, y] = label(corners);
    const [left, top] = map(x, y);
    const words = s("text", { x: left, y: top, class: "room-name" }, s("tspan", {}, apartment.rooms[name]), air);
    air.setAttribute("x", left);
    air.setAttribute("dy", "0.26");
    layers.rooms.append(shape);
    layers.walls.append(s("polygon", { points: points(corners), class: "wall" }), words);
    clip.append(s("polygon", { points: points(corners) }));
    rooms.set(name, { shape, air, lights: new Map(), values: new Map() });
  }
  for (const piece of plan.furniture) {
    const [x, y] = map(...piece.at);
    layers.furniture.append(s("rect", { x: round(x - piece.size[0] / 2), y: round(y - piece.size[1] / 2), width: piece.size[0], height: piece.size[1], rx: 0.05,
      transform: `rotate(${-piece.yaw_deg} ${x} ${y})` }, s("title", {}, piece.label)));
  }
  for (const robot of apartment.robots) if (robot.map) layers.maps.append(floor(robot, map));

  const stops = [];
  devices({ apartment, may, map, layers, rooms, stops });
  for (const camera of apartment.cameras) if (camera.mount) looking({ camera, map, layers, side, stops });
  markers({ map, layers, side, stops });
  for (const robot of apartment.robots) driving({ robot, map, layers, side, stops });
  stops.push(() => forget(HOME));
  return () => { for (const stop of stops) stop(); };
}

const section = (title, ...children) => h("section", { class: "panel" }, h("h2", {}, title), children);

function bounds(plan, apartment) {
  let all = Object.values(plan.rooms).flat();
  if (!all.length) all = apartment.robots.filter((robot) => robot.map).flatMap((robot) => corners(robot));
  if (!all.length) all = [[0, 0], [8, 6]];
  const [xs, ys] = [all.map(([x]) => x), all.map(([, y]) => y)];
  return { left: Math.min(...xs) - MARGIN, right: Math.max(...xs) + MARGIN, bottom: Math.min(...ys) - MARGIN, top: Math.max(...ys) + MARGIN };
}

function toApartment(robot, x, y) {
  const { x: ox, y: oy, yaw_deg: yaw } = robot.apartment_to_map;
  const [c, d] = [Math.cos(rad(yaw)), Math.sin(rad(yaw))];
  return [c * (x - ox) + d * (y - oy), -d * (x - ox) + c * (y - oy)];
}

function corners(robot) {
  const { origin: [x, y], size: [w, u] } = robot.map;
  return [[x, y], [x + w, y], [x + w, y + u], [x, y + u]].map(([a, b]) => toApartment(robot, a, b));
}

function floor(robot, map) {
  const [, , , corner] = corners(robot);
  const [x, y] = map(...corner);
  const [width, height] = robot.map.size;
  return s("image", { href: `/api/robots/${robot.name}/map.png`, x, y, width, height, preserveAspectRatio: "none", transform: `rotate(${robot.apartment_to_map.yaw_deg} ${x} ${y})` });
}

/** Where a room's name stands: the middle of its widest half. */
function label(shape) {
  const [xs, ys] = [shape.map(([x]) => x), shape.map(([, y]) => y)];
  const middle = (list) => (Math.min(...list) + Math.max(...list)) / 2;
  let best = [middle(xs), middle(ys), -1];
  for (let x = Math.min(...xs) + 0.1; x < Math.max(...xs); x += 0.2) {
    for (let y = Math.min(...ys) + 0.1; y < Math.max(...ys); y += 0.2) {
      const free = clearance(shape, x, y);
      if (free > best[2] + 0.01) best = [x, y, free];
    }
  }
  return best;
}

function clearance(shape, x, y) {
  let inside = false;
  let near = Infinity;
  shape.forEach(([ax, ay], index) => {
    const [bx, by] = shape[(index + 1) % shape.length];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
    const along = Math.max(0, Math.min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / ((bx - ax) ** 2 + (by - ay) ** 2)));
    near = Math.min(near, Math.hypot(x - ax - along * (bx - ax), y - ay - along * (by - ay)));
  });
  return inside ? near : -1;
}

function devices({ apartment, may, map, layers, rooms, stops }) {
  const shown = new Map();
  for (const [name, item] of Object.entries(apartment.items)) {
    const at = apartment.plan.at[name] ?? apartment.plan.at[item.thing];
    if (!at || [...shown.values()].some((one) => one.thing === item.thing && item.thing)) continue;
    const [x, y] = map(...at);
    const words = s("title", {}, `${item.label}: state unknown`);
    const toggles = may && item.commands && item.type === "Switch";
    const mark = s("g", { class: "thing unknown", transform: `translate(${x} ${y})`, role: toggles ? "button" : "img", tabindex: toggles ? "0" : null, "aria-label": `${item.label}: state unknown`, "data-item": name },
      words, s("circle", { r: 0.17 }), place(icon(item.icon)));
    const turn = () => {
      const value = shown.get(name).state === "ON" ? "OFF" : "ON";
      give(item.label, HOME, `/api/items/${name}/command`, { value }, (entry) => entry.topic === `home/${name}/state` && entry.text === value);
    };
    if (toggles) {
      mark.addEventListener("click", turn);
      mark.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        turn();
      });
    }
    layers.things.append(mark);
    shown.set(name, { mark, words, item, thing: item.thing, state: "" });
  }
  stops.push(live.watch("home/+/state", (entry) => {
    const name = entry.topic.split("/")[1];
    const item = apartment.items[name];
    const known = shown.get(name);
    if (known) {
      known.state = entry.text;
      known.mark.classList.toggle("on", ["ON", "OPEN", "PLAY"].includes(entry.text) || (["Dimmer", "Color"].includes(item.type) && Number.parseFloat(entry.text.split(",").at(-1)) > 0));
      known.mark.classList.toggle("unknown", NOTHING.has(entry.text));
      const told = `${item.label}: ${NOTHING.has(entry.text) ? "state unknown" : entry.text}`;
      text(known.words, told);
      known.mark.setAttribute("aria-label", told);
    }
    const room = item && rooms.get(item.room);
    if (!room) return;
    if (item.groups.includes("gLights")) {
      room.lights.set(name, Number.parseFloat(entry.text.split(",").at(-1)) > 0 || entry.text === "ON");
      room.shape.classList.toggle("lit", [...room.lights.values()].some(Boolean));
    }
    if (item.icon === "temperature" || item.icon === "humidity") {
      room.values.set(name, entry.text);
      text(room.air, [...room.values.values()].filter((value) => /\d/.test(value)).join(" · "));
    }
  }));
}

function markers({ map, layers, side, stops }) {
  const draw = () => {
    const found = live.all("camera/+/marker/+").map((entry) => entry.json).filter(Boolean);
    layers.markers.replaceChildren(...found.filter((one) => one.position).map((one) => {
      const [x, y] = map(one.position.x, one.position.y);
      const [a, b, turn] = ellipse(one.covariance);
      return s("g", { transform: `translate(${x} ${y})`, class: "marker", role: "img", "aria-label": `Marker ${one.marker}, ${one.place}`, "data-marker": one.marker },
        s("title", {}, `Marker ${one.marker}: seen from ${one.place}${one.covariance ? `, ± ${sure(one.covariance)} mm` : ""}`),
        s("ellipse", { rx: Math.max(0.04, a), ry: Math.max(0.04, b), transform: `rotate(${-turn})` }),
        s("rect", { x: -0.075, y: -0.075, width: 0.15, height: 0.15, rx: 0.02 }), s("text", { y: -0.14 }, `${one.marker}`));
    }));
    side.markers.replaceChildren(...found.map((one) => h("li", {}, h("strong", {}, `${one.marker}`), h("span", {}, `from ${one.place}`, h("span", { class: "hint" }, ` ${ago(Date.parse(one.stamp), live.now())}${one.covariance ? `, ± ${sure(one.covariance)} mm` : ""}`)))));
    if (!found.length) side.markers.append(h("li", { class: "hint" }, "None found yet"));
  };
  draw();
  stops.push(live.watch("camera/+/marker/+", draw));
}

/** The larger half axis at one sigma, in mm. */
const sure = (covariance) => Math.max(1, Math.round((ellipse(covariance)[0] / SIGMAS) * 1000));

/** Half axes of the horizontal part, metres at SIGMAS, and how the first is turned, degrees. */
function ellipse(covariance) {
  if (!covariance) return [0.15, 0.15, 0];
  const [[a, b], [, d]] = covariance;
  const middle = (a + d) / 2;
  const span = Math.hypot((a - d) / 2, b);
  return [SIGMAS * Math.sqrt(middle + span), SIGMAS * Math.sqrt(Math.max(0, middle - span)), (Math.atan2(2 * b, a - d) / 2) * (180 / Math.PI)];
}

function driving({ robot, map, layers, side, stops }) {
  const trail = [];
  const way = s("polyline", { class: "trail" });
  const ahead = s("path", { class: "ahead" });
  const body = s("g", { class: "robot", role: "img", "aria-label": `Robot ${robot.name}`, visibility: "hidden" }, s("title", {}, robot.name), s("circle", { r: robot.radius }), s("path", { d: `M${robot.radius - 0.02} 0L${robot.radius * 0.35} -0.1V0.1Z` }));
  layers.trails.append(way, ahead);
  layers.robots.append(body);
  const state = badge("");
  const said = h("span", { class: "hint" });
  side.robots.append(h("a", { class: "line-link", href: "#/missions" }, icon("robot"), h("strong", {}, robot.name), state, said));
  let here = null;
  const goal = () => {
    const mission = live.gone("mission") ? null : live.get(`mission/${robot.name}/state`)?.json;
    const point = mission?.state === "go" ? robot.points[mission.place] : null;
    ahead.setAttribute("d", point && here ? `M${map(...here).join(" ")}L${map(...point.at).join(" ")}` : "");
  };
  const fares = () => {
    const mission = live.get(`mission/${robot.name}/state`)?.json;
    const [away, pose] = [live.gone("mission"), live.get(`robot/${robot.name}/pose`)];
    const silent = pose && live.now() - pose.at > SILENT_S * 1000;
    text(state, away ? "mission service offline" : mission ? (WORDS[mission.state] ?? mission.state) : "");
    state.className = `badge ${away ? "bad" : ""}`;
    const words = !mission || mission.marker === null ? "" : `marker ${mission.marker}${mission.place ? `, ${mission.place}` : ""}`;
    text(said, silent ? `not heard of since ${clock(pose.at)}` : away ? "" : words);
    body.classList.toggle("gone", Boolean(silent));
    goal();
  };
  const ticking = setInterval(fares, 1000);
  stops.push(
    () => clearInterval(ticking),
    live.watch("service/mission/status", fares),
    live.watch(`mission/${robot.name}/state`, fares),
    live.values(`robot/${robot.name}/pose`, ({ json }) => {
      here = toApartment(robot, json.x, json.y);
      const last = trail.at(-1);
      if (!last || Math.hypot(here[0] - last[0], here[1] - last[1]) > 0.03) trail.push(here);
      if (trail.length > TRAIL) trail.shift();
      way.setAttribute("points", trail.map(([x, y]) => map(x, y).join()).join(" "));
      const [x, y] = map(...here);
      body.setAttribute("visibility", "visible");
      body.setAttribute("transform", `translate(${x} ${y}) rotate(${round(robot.apartment_to_map.yaw_deg - json.yaw_deg)})`);
      goal();
    }),
  );
}
