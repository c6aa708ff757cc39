"""A headless Chromium, Debian's own, and what tests want of a page."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import axe_playwright_python
from playwright.sync_api import Browser, ConsoleMessage, Page, sync_playwright

from services import peers

PHONE = {"width": 390, "height": 844}
DESKTOP = {"width": 1366, "height": 860}
VIEWS = ("apartment", "camera", "devices", "history", "missions", "health", "bus")
WAIT_MS = 30_000  # a busy machine
AXE = Path(axe_playwright_python.__file__).with_name("axe.min.js")
AWAY = re.compile(
    r"ERR_(INCOMPLETE_CHUNKED_ENCODING|CONNECTION_REFUSED|CONNECTION_RESET|EMPTY_RESPONSE)|\b(401|422|429|503)\b"
)


@contextmanager
def chromium() -> Iterator[Browser]:
    """The browser; Missing where it is not installed."""
    program = peers.program("chromium", "chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=program, args=["--no-sandbox", "--disable-gpu", "--mute-audio"]
        )
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def page(browser: Browser, url: str, *, size: Any = None, scheme: Any = "light") -> Iterator[Page]:
    """A page of its own, with its own cookies. What it complains of is an error here."""
    complaints: list[str] = []
    context = browser.new_context(base_url=url, viewport=size or DESKTOP, color_scheme=scheme, locale="en-GB")
    context.set_default_timeout(WAIT_MS)
    context.add_init_script(PRESSING)
    made = context.new_page()
    made.on("pageerror", lambda error: complaints.append(str(error)))
    made.on("console", lambda said: complaints.extend(_complaint(said)))
    try:
        yield made
    finally:
        context.close()
    assert complaints == []


def _complaint(said: ConsoleMessage) -> list[str]:
    """What the browser itself says when a server is away, or refuses as it should, is no fault of the page."""
    if said.type != "error" or AWAY.search(said.text):
        return []
    return [said.text]


def view(page: Page, name: str) -> None:
    """Opens a view, and waits until it is live."""
    page.goto(f"/#/{name}")
    page.locator(f"main.view-{name} h1").wait_for()
    page.locator(".link[data-state=live]").wait_for()


def faults(page: Page) -> list[str]:
    """What axe-core finds serious or critical in what is shown."""
    if not page.evaluate("'axe' in window"):
        page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("() => axe.run(document, {resultTypes: ['violations']})")
    return [
        f"{one['id']}: {node['html'][:160]} ({node['failureSummary'][:200]})"
        for one in found["violations"]
        if one["impact"] in ("serious", "critical")
        for node in one["nodes"]
    ]


PRESSING = """(() => {
  const CONTROLS = "button, input, select, textarea, a[href], summary, " +
    "[role=button], [role=application], [role=treeitem]";
  const TYPED = "input:not([type=checkbox]), textarea, select"; // a click there only puts the cursor in
  const LISTS = {".places button": "a place", ".items li input": "an item", ".items li a": "an item's table",
    ".topic .name": "a topic", "[role=treeitem]": "a component", summary: "a past mission"};
  const nameOf = (element) => {
    for (const [selector, name] of Object.entries(LISTS)) if (element.matches(selector)) return name;
    if (element.matches(".line-link")) return element.hash;
    if (element.matches("[data-item]")) return element.dataset.item;
    const told = element.getAttribute("aria-label") ?? element.labels?.[0]?.textContent ?? element.textContent;
    return (element.matches("[aria-pressed], .quiet") ? told.split(":")[0] : told).trim();
  };
  const inside = (root) => [...new Set([...document.querySelector(root).querySelectorAll(CONTROLS)].map(nameOf))];
  const pressed = new Set();
  const note = (event) => {
    const control = event.target.closest?.(CONTROLS);
    if (control && !(event.type === "click" && control.matches(TYPED))) pressed.add(nameOf(control));
  };
  for (const type of ["click", "change", "input", "pointerdown", "keydown"]) addEventListener(type, note, true);
  window.unpressed = (root) => inside(root).filter((name) => !pressed.has(name)).sort();
})()"""


def unpressed(page: Page, root: str = "main") -> list[str]:
    """The controls that are shown and that nobody has used since the page was loaded; those of a list count as one.

    The page was made with `PRESSING` as its first script.
    """
    found: list[str] = page.evaluate("root => window.unpressed(root)", root)
    return found
