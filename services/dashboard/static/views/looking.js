// Where a camera looks, on the plan: the part of the floor that its picture shows, and how it fares beside it.

import { badge, h, icon, s, text } from "../dom.js";
import * as live from "../live.js";

const REACH = 9; // m: how far a level look is drawn
const PER_LEVEL = 0.375; // of a zoom that nobody calibrated
const STEPS = 12;
export const rad = (degrees) => (degrees * Math.PI) / 180;
export const round = (number) => Math.round(number * 1000) / 1000;

/** Puts an icon into the middle of a mark on the plan. */
export function place(drawing) {
  drawing.setAttribute("x", -0.11);
  drawing.setAttribute("y", -0.11);
  drawing.setAttribute("width", 0.22);
  drawing.setAttribute("height", 0.22);
  return drawing;
}

/** Draws one camera, and follows it until `stops` are called. */
export function looking({ camera, map, layers, side, stops }) {
  const { mount, lens } = camera;
  const view = s("path", { class: "view", "clip-path": "url(#inside)", "data-camera": camera.name });
  const cone = s("path", { class: "cone", "clip-path": "url(#inside)" });
  const middle = s("path", { class: "axis", "clip-path": "url(#inside)" });
  const [x, y] = map(mount.position[0], mount.position[1]);
  const title = s("title", {}, `Camera ${camera.name}`);
  layers.views.append(cone, view, middle);
  const mark = s("g", { class: "thing camera-mark", transform: `translate(${x} ${y})`, role: "img", "aria-label": `Camera ${camera.name}` }, title, s("circle", { r: 0.19 }), place(icon("camera")));
  layers.things.append(mark);
  const state = badge("");
  const said = h("span", { class: "hint" });
  const link = h("a", { class: "line-link", href: "#/camera" }, icon("camera"), h("strong", {}, camera.name), state, said);
  const scanning = h("p", { class: "hint" });
  side.cameras.append(link, scanning);
  const service = `camera-${camera.name}`;
  const fares = () => {
    const [told, scan, away] = [live.get(`camera/${camera.name}/status`)?.json, live.get(`camera/${camera.name}/scan/state`)?.json, live.gone(service)];
    text(state, away ? "service offline" : (told?.state ?? ""));
    state.className = `badge ${!away && told?.state === "online" ? "good" : "bad"}`;
    text(scanning, scan?.state === "running" && !away ? `Scanning for ${scan.targets.join(", ")}: ${Math.round(scan.progress * 100)} %` : "");
    const at = live.get(`camera/${camera.name}/position`)?.json;
    const there = at && (at.place ?? `pan ${at.pan.toFixed(0)}°, tilt ${at.tilt.toFixed(0)}°`);
    text(said, !at ? "" : away ? `last seen at ${there}` : at.moving ? "moving" : there);
    for (const one of [view, cone, middle, mark]) one.classList.toggle("gone", away);
  };
  stops.push(
    live.watch(`camera/${camera.name}/status`, fares),
    live.watch(`camera/${camera.name}/scan/state`, fares),
    live.watch(`service/${service}/status`, fares),
    live.values(`camera/${camera.name}/position`, ({ json }) => {
      const times = magnified(lens, json.zoom);
      const across = lens ? 2 * Math.atan(Math.tan(rad(lens.across_deg) / 2) / times) : rad(60);
      const up = lens ? 2 * Math.atan(Math.tan(rad(lens.up_deg) / 2) / times) : rad(40);
      const azimuth = rad(mount.kind === "ceiling" ? mount.yaw_deg - json.pan : mount.yaw_deg + json.pan);
      const down = rad(json.tilt - mount.tilt_zero_deg);
      const height = mount.position[2];
      const seen = footprint({ azimuth, down, across, up, height, at: mount.position, map });
      view.setAttribute("d", `M${seen.join("L")}Z`);
      cone.setAttribute("d", `M${x} ${y}L${seen[STEPS]}L${seen[0]}M${x} ${y}L${seen[2 * STEPS]}L${seen[3 * STEPS]}`);
      const far = floorAt(height, down);
      const [ex, ey] = map(mount.position[0] + far * Math.cos(azimuth), mount.position[1] + far * Math.sin(azimuth));
      middle.setAttribute("d", `M${x} ${y}L${ex} ${ey}`);
      view.dataset.azimuth = round((azimuth * 180) / Math.PI);
      fares();
    }),
  );
}

const floorAt = (height, down) => (down <= 0.02 ? REACH : Math.min(REACH, height / Math.tan(down)));

/** The part of the floor that the picture shows, as the rays of its border hit it: STEPS points on each side. */
function footprint({ azimuth, down, across, up, height, at, map }) {
  const rays = [];
  const [w, u] = [Math.tan(across / 2), Math.tan(up / 2)];
  const border = (fx, fy) => {
    const [x, y] = [fx * w, fy * u];
    const out = Math.cos(down) - y * Math.sin(down);
    const fall = Math.sin(down) + y * Math.cos(down);
    const far = Math.hypot(out, x);
    const reach = fall <= 0.02 * far ? REACH / far : Math.min(REACH / far, height / fall);
    rays.push([reach * out, -reach * x]);
  };
  for (let i = 0; i <= STEPS; i++) border(-1 + (2 * i) / STEPS, -1);
  for (let i = 1; i <= STEPS; i++) border(1, -1 + (2 * i) / STEPS);
  for (let i = 1; i <= STEPS; i++) border(1 - (2 * i) / STEPS, 1);
  for (let i = 1; i < STEPS; i++) border(-1, 1 - (2 * i) / STEPS);
  const [c, d] = [Math.cos(azimuth), Math.sin(azimuth)];
  return rays.map(([fx, fy]) => map(at[0] + c * fx - d * fy, at[1] + d * fx + c * fy).join(" "));
}

function magnified(lens, zoom) {
  if (!lens?.levels.length) return 1 + PER_LEVEL * Math.max(0, zoom);
  const above = lens.levels.find(([level]) => level >= zoom) ?? lens.levels.at(-1);
  return above[1];
}
