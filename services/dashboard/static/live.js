// What the apartment says, live: one stream of server-sent events for what the view asks for, and the newest of each
// topic. A page that is not looked at closes its stream after a while, and has everything again when it is.

const HIDDEN_S = 15;
const AGAIN_S = 2;
const SILENT_S = 25; // the server says something every 10 s: a network that takes everything and brings nothing is noticed
const LOOK_S = 5;
const ALWAYS = ["/dashboard/broker", "service/+/status", "camera/+/order_result"];

const latest = new Map();
let watchers = [];
let wanted = [];
let source = null;
let again = 0;
let looks = 0;
let asked = 0;
let heard = 0; // ms by our clock, as `asked`
let ahead = 0; // ms: the server's clock before ours
let hide = 0;
let lost = () => {};
let state = "connecting";

/** One message. `json` is its payload as a value, null when it is none. */
class Entry {
  constructor([topic, payload, at, kind], fresh) {
    this.topic = topic;
    this.text = payload;
    this.at = at;
    this.kind = kind;
    this.fresh = fresh; // came just now; not from before the page was opened
    this.parsed = undefined;
  }

  get json() {
    if (this.parsed === undefined) {
      try {
        this.parsed = JSON.parse(this.text);
      } catch {
        this.parsed = null;
      }
    }
    return this.parsed;
  }
}

export function matcher(filter) {
  const escaped = filter.replace(/[.*?^${}()|[\]\\]/g, "\\$&");
  const pattern = escaped.replace(/\+/g, "[^/]+").replace(/\/#$/, "(/.*)?").replace(/^#$/, "[^/].*");
  const whole = new RegExp(`^${pattern}$`);
  return (topic) => whole.test(topic);
}

/** The newest message on a topic. */
export const get = (topic) => latest.get(topic);

/** The newest messages on all topics that match. */
export function all(filter) {
  const matches = matcher(filter);
  return [...latest.values()].filter((entry) => matches(entry.topic));
}

/** Calls `take(entry)` for what is known already and for all that comes; the result ends that. */
export function watch(filter, take) {
  const watcher = { exact: /[+#]/.test(filter) ? null : filter, matches: matcher(filter), take };
  watchers.push(watcher);
  for (const entry of [...latest.values()]) if (watcher.matches(entry.topic)) take(entry);
  return () => {
    watchers = watchers.filter((one) => one !== watcher);
  };
}

/** The same for those that have a value: without what is taken away, and what is no JSON. */
export const values = (filter, take) => watch(filter, (entry) => {
  if (entry.json !== null) take(entry);
});

/** Calls `take(entries)` once for every batch, for views that draw everything anew. */
export function batches(take) {
  const watcher = { batch: take };
  watchers.push(watcher);
  return () => {
    watchers = watchers.filter((one) => one !== watcher);
  };
}

/** Whether we hear the apartment: "live", "connecting", or "broker" when the dashboard has no broker. */
export const connection = () => (state === "live" && get("/dashboard/broker")?.text !== "online" ? "broker" : state);

/** What time it is where `at` of messages comes from, ms: this machine's clock may be another. */
export const now = () => Date.now() + ahead;

/** Up to when what is shown is what is, ms by our clock; 0: nothing has come yet. */
export const until = () => (connection() === "broker" && get("/dashboard/broker") ? get("/dashboard/broker").at - ahead : heard);

/** Whether a service has ended, by its own word or its last will; one that nobody has heard of has not. */
export const gone = (service) => get(`service/${service}/status`)?.text === "offline";

/** Asks for these topics from now on; `onLost` is called when the server sends us away (the session has ended). */
export function listen(topics, onLost) {
  const now = [...new Set([...ALWAYS, ...topics])].sort();
  if (onLost) lost = onLost;
  if (source && now.join() === wanted.join()) return;
  wanted = now;
  connect();
}

export function end() {
  source?.close();
  source = null;
  wanted = [];
  latest.clear();
  clearTimeout(again);
  clearInterval(looks);
  state = "connecting";
  heard = 0;
}

function connect() {
  clearTimeout(again);
  source?.close();
  clearInterval(looks);
  if (!wanted.length) return;
  asked = Date.now();
  looks = setInterval(look, LOOK_S * 1000);
  source = new EventSource(`/api/live?topics=${encodeURIComponent(wanted.join(","))}`);
  const hear = (type, then) => source.addEventListener(type, (event) => {
    heard = Date.now();
    then(event);
  });
  hear("snapshot", (event) => {
    ahead = event.lastEventId - heard;
    forget();
    const rows = JSON.parse(event.data);
    take([...takenAway(rows), ...rows], false);
    tell("live");
  });
  hear("beat", (event) => { ahead = Math.max(ahead, event.lastEventId - heard); }); // the quickest is nearest to the truth
  hear("message", (event) => take(JSON.parse(event.data), true));
  source.onerror = () => {
    tell("connecting");
    if (source?.readyState === EventSource.CLOSED) again = setTimeout(comeBack, AGAIN_S * 1000);
  };
}

/** A connection that says nothing is none, whatever the browser believes. */
function look() {
  if (!source || Date.now() - Math.max(asked, heard) < SILENT_S * 1000) return;
  tell("connecting");
  connect();
}

/** Without what this view does not hear any more: it would grow old unseen. */
function forget() {
  const heard = wanted.map(matcher);
  for (const topic of latest.keys()) if (!heard.some((matches) => matches(topic))) latest.delete(topic);
}

/** Of the states that we know those that a snapshot has not any more: they went while we did not listen. */
function takenAway(rows) {
  const there = new Set(rows.map(([topic]) => topic));
  return [...latest.values()].filter(({ topic, kind }) => kind === "s" && !there.has(topic)).map(({ topic }) => [topic, "", now(), "s"]);
}

async function comeBack() {
  try {
    const answer = await fetch("/api/session");
    if (answer.ok && (await answer.json()).user === null) return lost();
  } catch {
    // it is away: the next attempt tells
  }
  connect();
}

function take(rows, fresh) {
  const came = rows.map((row) => new Entry(row, fresh));
  for (const entry of came) {
    if (entry.text === "" && entry.kind === "s") latest.delete(entry.topic);
    else latest.set(entry.topic, entry);
  }
  for (const watcher of [...watchers]) {
    if (watcher.batch) alone(watcher.batch, came);
    else for (const entry of came) if (watcher.exact ? watcher.exact === entry.topic : watcher.matches(entry.topic)) alone(watcher.take, entry);
  }
  if (rows.some((row) => row[0] === "/dashboard/broker")) tell(state);
}

/** One watcher that fails takes nothing from the others. */
function alone(call, value) {
  try {
    call(value);
  } catch (error) {
    reportError(error);
  }
}

function tell(now) {
  state = now;
  document.dispatchEvent(new CustomEvent("connection", { detail: connection() }));
}

document.addEventListener("visibilitychange", () => {
  clearTimeout(hide);
  if (document.hidden) {
    hide = setTimeout(() => {
      source?.close();
      source = null;
    }, HIDDEN_S * 1000);
  } else if (source) {
    look();
  } else if (wanted.length) {
    tell("connecting");
    connect();
  }
});

/** Another network: connections of the one before may say nothing for ever. */
window.addEventListener("online", () => source && connect());
