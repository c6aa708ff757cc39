// Orders that were given here: whoever carries one out has to answer it, and who gave it is told when nobody does.

import * as api from "./api.js";
import { toast } from "./dom.js";
import * as live from "./live.js";

const ANSWER_S = 10; // an order that is handled after 5 s is refused, so it is answered by then if anybody is there
const ENDS = new Set(["done", "failed", "refused", "cancelled"]);

const open = new Set();

/** One order. Its answers carry its id; an answer may come before we know that. */
class Given {
  constructor(what, service, answers) {
    Object.assign(this, { what, service, answers, id: null, early: [], said: "", at: 0, timer: 0 });
    open.add(this);
  }

  begin(id) {
    this.id = id ?? "";
    this.wait("no answer");
    for (const entry of this.early) this.take(entry);
  }

  take(entry) {
    if (this.id === null) {
      this.early.push(entry);
    } else if (this.answers(entry, this.id)) {
      const said = entry.json?.state ?? "";
      if (entry.at < this.at || (entry.at === this.at && said === this.said)) return; // told again to a page that came back
      clearTimeout(this.timer);
      Object.assign(this, { said, at: entry.at, timer: 0 });
      if (!this.service.startsWith("camera-") || ENDS.has(this.said)) this.end();
    }
  }

  /** Who carries it out was away: it may be forgotten, and its end may have been missed. */
  lost() {
    if (this.said && !this.timer) this.wait(`it was ${this.said} when its service or the broker went away`);
  }

  wait(why) {
    this.timer = setTimeout(() => {
      this.end();
      toast(`${this.what}: ${why}`, "bad");
    }, ANSWER_S * 1000);
  }

  end() {
    clearTimeout(this.timer);
    open.delete(this);
  }
}

const carries = ({ json }, id) => json?.id === id || json?.waiting?.includes?.(id);

/** Gives an order that this service answers, as `api.order` does. `answers(entry, id)`: whether a message is an answer. */
export async function give(what, service, path, body, answers = carries) {
  const given = new Given(what, service, answers);
  const told = await api.order(path, body);
  if (!open.has(given)) return told;
  if (told) given.begin(told.id);
  else given.end();
  return told;
}

/** Forgets the orders to a service, whose answers are not heard any more; without a name all. */
export function forget(service) {
  for (const given of [...open]) if (!service || given.service === service) given.end();
}

for (const filter of ["camera/+/order_result", "mission/+/state", "mission/+/result", "mission/+/where/reply/+", "home/+/state"]) {
  live.watch(filter, (entry) => { for (const given of [...open]) given.take(entry); });
}
live.watch("service/+/status", (entry) => {
  if (entry.text === "offline") for (const given of open) if (entry.topic === `service/${given.service}/status`) given.lost();
});
document.addEventListener("connection", (event) => { if (event.detail === "broker") for (const given of open) given.lost(); });
