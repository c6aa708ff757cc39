// A camera's moving picture, from the dashboard's own server; a still one while the stream is off.
// A browser leaves the last picture of a stream where it is when no more come, and says nothing: the server does.

import { h, text } from "../dom.js";
import * as live from "../live.js";

const AGAIN_MS = 3000;
const STILL_MS = 15000;
const DRAW_MS = 1000;

/** `click(right, down)` gets where somebody clicked, as shares of the picture. */
export function video(camera, click) {
  const image = h("img", { class: "picture", alt: `Picture of camera ${camera}`, draggable: "false" });
  const said = h("p", { class: "over" });
  const aim = h("span", { class: "aim", "aria-hidden": "true" });
  const element = h("div", { class: "video" }, image, aim, said);
  let mode = "";
  let timer = 0;
  let fault = "Waiting for a picture …";
  let flows = true;
  let linked = true;

  const load = () => {
    clearTimeout(timer);
    if (document.hidden || !mode) return;
    image.src = `/api/cameras/${camera}/${mode === "live" ? "stream.mjpg" : "snapshot.jpg"}?${Date.now()}`;
  };
  const draw = () => {
    const flow = mode === "live" ? live.get(`/dashboard/video/${camera}`)?.json : null;
    const stands = flow?.flows === false ? `No picture for ${Math.max(0, Math.round((live.now() - flow.since) / 1000))} s: ${flow.why}` : "";
    text(said, stands || fault);
    said.hidden = !said.textContent;
    element.classList.toggle("old", !said.hidden);
  };
  image.onload = () => {
    fault = "";
    draw();
    element.classList.add("seen");
    if (mode === "still") timer = setTimeout(load, STILL_MS);
  };
  image.onerror = () => {
    if (!image.getAttribute("src")) return;
    fault = mode === "live" ? "The stream has not begun yet" : "No picture from the camera";
    draw();
    timer = setTimeout(load, AGAIN_MS);
  };
  const stops = [
    live.watch(`/dashboard/video/${camera}`, ({ json }) => {
      if (mode === "live" && json?.flows !== false && !(flows && json)) load(); // it flows again; or it is sent to nobody, so not to us
      flows = json?.flows ?? true;
      draw();
    }),
  ];
  const relinked = ({ detail }) => {
    if (!linked && detail === "live" && mode === "live") load();
    linked = detail === "live";
  };
  document.addEventListener("connection", relinked);
  const ticking = setInterval(draw, DRAW_MS);
  const visible = () => {
    if (document.hidden) image.removeAttribute("src"); // ends the connection
    else load();
  };
  document.addEventListener("visibilitychange", visible);
  if (click) {
    image.classList.add("can");
    image.addEventListener("click", (event) => {
      const box = image.getBoundingClientRect();
      const [right, down] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
      aim.style.left = `${right * 100}%`;
      aim.style.top = `${down * 100}%`;
      aim.classList.remove("shown");
      requestAnimationFrame(() => aim.classList.add("shown"));
      click(right, down);
    });
  }
  draw();
  return { element, show(moving) {
    const wanted = moving ? "live" : "still";
    if (wanted === mode) return;
    mode = wanted;
    load();
    draw();
  }, close() {
    mode = "";
    clearTimeout(timer);
    clearInterval(ticking);
    for (const stop of stops) stop();
    document.removeEventListener("connection", relinked);
    document.removeEventListener("visibilitychange", visible);
    image.removeAttribute("src");
  } };
}
