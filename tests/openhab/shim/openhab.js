// A stand-in for OpenHAB's library `openhab` and the part of OpenHAB behind it that rules for the bus meet.
//
// It reads events as JSON lines from standard input and says what rules do as JSON lines. Groups have direct members
// only, a command becomes the state where the item follows it, and rules run after an event, as in OpenHAB.
// It knows nothing of the rules: what they are is what they register.
'use strict';

const registry = new Map(); // name -> {type, state, groups, autoupdate}
const registered = []; // {name, triggers, execute}
const online = new Set(); // things
const say = (line) => process.stdout.write(`${JSON.stringify(line)}\n`);

class Item {
  constructor(name) {
    this.name = name;
  }

  get type() {
    return registry.get(this.name).type;
  }

  get state() {
    return registry.get(this.name).state;
  }

  get groupNames() {
    return [...registry.get(this.name).groups];
  }

  get members() {
    return [...registry.keys()].filter((name) => registry.get(name).groups.includes(this.name)).map((name) => new Item(name));
  }

  sendCommand(value) {
    say({ command: this.name, value });
    if (registry.get(this.name).autoupdate) {
      this.postUpdate(value);
    }
  }

  postUpdate(value) {
    say({ update: this.name, value });
    const item = registry.get(this.name);
    const before = item.state;
    item.state = value;
    if (before !== value) {
      const event = { itemName: this.name, oldState: before, newState: value };
      setImmediate(() => fire((one) => one.kind === 'changed' && item.groups.includes(one.group), event));
    }
  }
}

const items = {
  getItem(name, nullIfMissing = false) {
    if (registry.has(name)) {
      return new Item(name);
    }
    if (nullIfMissing) {
      return null;
    }
    throw new Error(`there is no item ${name}`);
  },
};

const triggers = {
  GroupStateChangeTrigger: (group, oldState, newState) => ({ kind: 'changed', group, oldState, newState }),
  SystemStartlevelTrigger: (level) => ({ kind: 'startlevel', level }),
  ThingStatusChangeTrigger: (thing, status) => ({ kind: 'thing', thing, status }),
  ChannelEventTrigger: (channel) => ({ kind: 'channel', channel }),
};

const rules = {
  JSRule(rule) {
    registered.push(rule);
    say({ rule: rule.name, triggers: rule.triggers });
  },
};

const actions = {
  Things: {
    getActions(scope, uid) {
      if (scope !== 'mqtt' || !online.has(uid)) {
        return null;
      }
      return { publishMQTT: (topic, value, retained) => say({ publish: topic, value, retained }) };
    },
  },
};

function fire(fits, event) {
  for (const rule of registered) {
    if (rule.triggers.some(fits)) {
      rule.execute(event);
    }
  }
}

const happenings = {
  items(line) {
    for (const [name, item] of Object.entries(line.items)) {
      registry.set(name, item);
    }
  },
  startlevel: (line) => fire((one) => one.kind === 'startlevel' && one.level === line.level, {}),
  thing(line) {
    if (line.status === 'ONLINE') {
      online.add(line.thing);
    } else {
      online.delete(line.thing);
    }
    fire((one) => one.kind === 'thing' && one.thing === line.thing && one.status === line.status, {});
  },
  channel: (line) =>
    fire((one) => one.kind === 'channel' && one.channel === line.channel, { channelUID: line.channel, receivedEvent: line.event }),
  update: (line) => new Item(line.item).postUpdate(line.value),
  fence: (line) => setImmediate(() => setImmediate(() => say({ fence: line.number }))),
};

console.warn = (text) => say({ warn: text });
require('readline')
  .createInterface({ input: process.stdin })
  .on('line', (text) => {
    const line = JSON.parse(text);
    happenings[line.kind](line);
  });

module.exports = { rules, triggers, items, actions };
