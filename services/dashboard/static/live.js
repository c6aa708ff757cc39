// What the apartment says, live: one stream of server-sent events for what the view asks for, and the newest of each
// topic. A page that is not looked at closes its stream after a while, and has everything again when it is.

const HIDDEN_S = 15;
const AGAIN_S = 2;
const ALWAYS = ["/dashboard/broker", "service/+/status", "camera/+/order_result"];

const latest = new Map();
let watchers = [];
let wanted = [];
let source = null;
let again = 0;
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
export const connection = () => (state === "live" && get("/dashboard/broker")?.text === "offline" ? "broker" : state);

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
}

function connect() {
  clearTimeout(again);
  source?.close();
  if (!wanted.length) return;
  source = new EventSource(`/api/live?topics=${encodeURIComponent(wanted.join(","))}`);
  source.addEventListener("snapshot", (event) => {
    forget();
    take(JSON.parse(event.data), false);
    tell("live");
  });
  source.onmessage = (event) => take(JSON.parse(event.data), true);
  source.onerror = () => {
    tell("connecting");
    if (source?.readyState === EventSource.CLOSED) again = setTimeout(comeBack, AGAIN_S * 1000);
  };
}

/** Without what this view does not hear any more: it would grow old unseen. */
function forget() {
  const heard = wanted.map(matcher);
  for (const topic of latest.keys()) if (!heard.some((matches) => matches(topic))) latest.delete(topic);
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
  } else if (!source && wanted.length) {
    connect();
  }
});
