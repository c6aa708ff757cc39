// The frame around the views: who is logged in, where one is, light or dark, and whether we hear the apartment.

import * as api from "./api.js";
import { clock, h, icon, text, toast } from "./dom.js";
import { forget } from "./given.js";
import * as live from "./live.js";

const VIEWS = [
  ["apartment", "Apartment"], ["camera", "Camera"], ["devices", "Devices"], ["history", "History"],
  ["missions", "Missions"], ["health", "Health"], ["bus", "Bus"],
];
const THEMES = ["auto", "light", "dark"];
const LINK = { live: "Live", connecting: "Connecting …", broker: "No broker" };
const CUT = { connecting: "No connection to the dashboard", broker: "The dashboard has no broker, so nothing can be ordered" };
const CUT_MS = 1500; // a connection that is back sooner disturbs nobody

const app = document.getElementById("app");
let context = null;
let leave = () => {};
let showing = 0;
let cut = 0;

function theme(name) {
  if (name === "auto") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = name;
  localStorage.setItem("theme", name);
  document.dispatchEvent(new Event("theme"));
}

function themeButton() {
  const now = () => localStorage.getItem("theme") ?? "auto";
  const label = h("span", { class: "label" }, now());
  const next = () => {
    theme(THEMES[(THEMES.indexOf(now()) + 1) % THEMES.length]);
    text(label, now());
    button.setAttribute("aria-label", `Colours: ${now()}`);
  };
  const button = h("button", { class: "quiet", onclick: next, "aria-label": `Colours: ${now()}`, title: "Colours" }, icon("theme"), label);
  return button;
}

function frame() {
  const links = VIEWS.map(([name, title]) => h("a", { href: `#/${name}`, "data-view": name }, icon(name), h("span", {}, title)));
  const link = h("span", { class: "link", role: "img" });
  const who = context.session.login
    ? h("button", { class: "quiet", onclick: logout, title: "Log out" }, icon("leave"), h("span", { class: "label" }, context.session.user))
    : null;
  const role = context.session.role === "viewer" ? h("span", { class: "badge" }, "looking only") : null;
  app.replaceChildren(
    h("aside", { class: "side" },
      h("div", { class: "brand" }, h("img", { src: "/icon.svg", alt: "", width: 26, height: 26 }), h("span", {}, "Apartment"), link),
      h("nav", { "aria-label": "Views" }, links),
      h("div", { class: "foot" }, role, themeButton(), who)),
    h("div", { class: "page" }, h("div", { class: "cut", role: "status" }), h("main", { id: "main", tabindex: "-1" })),
  );
  linked();
}

/** Says whether we hear the apartment: a dot, and in words where we do not, since all that is shown is old then. */
function linked() {
  const [link, banner, now] = [app.querySelector(".link"), app.querySelector(".cut"), live.connection()];
  if (!link || link.dataset.state === now) return;
  link.dataset.state = now;
  link.title = LINK[now];
  link.setAttribute("aria-label", LINK[now]);
  clearTimeout(cut);
  if (now === "live") return cutOff(banner, "");
  const say = () => cutOff(banner, `${CUT[now]}. ${live.until() ? `What is shown is of ${clock(live.until())} or before.` : ""}`);
  if (banner.textContent) say();
  else cut = setTimeout(say, CUT_MS);
}

function cutOff(banner, words) {
  text(banner, words);
  document.body.classList.toggle("cut-off", words !== "");
}

async function show() {
  const name = location.hash.match(/^#\/(\w+)/)?.[1] ?? "apartment";
  const [view, title] = VIEWS.find(([known]) => known === name) ?? VIEWS[0];
  const turn = ++showing;
  const module = await import(`./views/${view}.js`);
  if (turn !== showing) return;
  const main = document.getElementById("main");
  leave();
  main.replaceChildren();
  main.className = `view-${view}`;
  document.title = `${title} · Apartment`;
  for (const a of app.querySelectorAll("nav a")) {
    if (a.dataset.view === view) a.setAttribute("aria-current", "page");
    else a.removeAttribute("aria-current");
  }
  live.listen(module.topics, login);
  leave = module.show(main, context) ?? (() => {});
  main.querySelector("h1")?.focus({ preventScroll: true });
  window.scrollTo(0, 0);
}

async function logout() {
  await api.order("/api/logout");
  login();
}

async function login() {
  live.end();
  forget();
  clearTimeout(cut);
  document.body.classList.remove("cut-off");
  leave();
  leave = () => {};
  window.removeEventListener("hashchange", show);
  const module = await import("./views/login.js");
  document.title = "Log in · Apartment";
  module.show(app, enter);
}

async function enter(session) {
  try {
    context = { session, may: session.role === "operator", apartment: await api.get("/api/apartment") };
  } catch (error) {
    toast(error.message, "bad");
    return;
  }
  frame();
  document.body.classList.toggle("looking", !context.may);
  window.addEventListener("hashchange", show);
  await show();
}

document.addEventListener("connection", linked);

/** An order's end is told wherever one is; only what was ordered from a page of this browser. */
live.watch("camera/+/order_result", (entry) => {
  const result = entry.json;
  if (!entry.fresh || !result?.id?.startsWith("page-")) return;
  if (result.state === "failed" || result.state === "refused") toast(`${result.key}: ${result.error ?? result.state}`, "bad");
});

/** The hash names the view, so this link must not change it. */
document.querySelector(".skip").addEventListener("click", (event) => {
  event.preventDefault();
  document.getElementById("main")?.focus();
});

theme(localStorage.getItem("theme") ?? "auto");
const session = await api.get("/api/session").catch((error) => toast(error.message, "bad"));
if (session) await (session.user === null ? login() : enter(session));
