// A camera's moving picture, from the dashboard's own server; a still one while the stream is off.

import { h, text } from "../dom.js";

const AGAIN_MS = 3000;
const STILL_MS = 15000;

/** `click(right, down)` gets where somebody clicked, as shares of the picture. */
export function video(camera, click) {
  const image = h("img", { class: "picture", alt: `Picture of camera ${camera}`, draggable: "false" });
  const said = h("p", { class: "over" }, "Waiting for a picture …");
  const aim = h("span", { class: "aim", "aria-hidden": "true" });
  const element = h("div", { class: "video" }, image, aim, said);
  let mode = "";
  let timer = 0;

  const load = () => {
    clearTimeout(timer);
    if (document.hidden || !mode) return;
    image.src = `/api/cameras/${camera}/${mode === "live" ? "stream.mjpg" : "snapshot.jpg"}?${Date.now()}`;
  };
  image.onload = () => {
    said.hidden = true;
    element.classList.add("seen");
    if (mode === "still") timer = setTimeout(load, STILL_MS);
  };
  image.onerror = () => {
    if (!image.getAttribute("src")) return;
    text(said, mode === "live" ? "The stream has not begun yet" : "No picture from the camera");
    said.hidden = false;
    timer = setTimeout(load, AGAIN_MS);
  };
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
  return { element, show(live) {
    const wanted = live ? "live" : "still";
    if (wanted === mode) return;
    mode = wanted;
    load();
  }, close() {
    mode = "";
    clearTimeout(timer);
    document.removeEventListener("visibilitychange", visible);
    image.removeAttribute("src");
  } };
}
