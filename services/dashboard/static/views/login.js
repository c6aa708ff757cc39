// Logging in.

import * as api from "../api.js";
import { h, text } from "../dom.js";

export function show(root, enter) {
  const why = h("p", { class: "why", role: "alert" });
  const user = h("input", { id: "user", name: "user", autocomplete: "username", required: true, maxlength: 100 });
  const password = h("input", { id: "password", name: "password", type: "password", autocomplete: "current-password", required: true });
  const button = h("button", { class: "main", type: "submit" }, "Log in");
  const submit = async (event) => {
    event.preventDefault();
    button.disabled = true;
    text(why, "");
    try {
      await enter(await api.post("/api/login", { user: user.value, password: password.value }));
    } catch (error) {
      if (!(error instanceof api.Refused)) throw error;
      text(why, error.message);
      password.value = "";
      password.focus();
    } finally {
      button.disabled = false;
    }
  };
  root.replaceChildren(
    h("main", { class: "login", id: "main" },
      h("form", { onsubmit: submit },
        h("img", { src: "/icon.svg", alt: "", width: 44, height: 44 }),
        h("h1", {}, "Apartment"),
        h("label", { for: "user" }, "Name"), user,
        h("label", { for: "password" }, "Password"), password,
        why, button)));
  user.focus();
}
