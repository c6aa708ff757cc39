-- Version 2, SQLite: what keeps a redelivered message from being stored twice, and means of closed intervals.
DROP TABLE mqtt_session;

CREATE TABLE mqtt_seen (                  -- per writer and turn: packet ids and checksums of what the turn handled
  client TEXT NOT NULL, slot INTEGER NOT NULL, turn INTEGER NOT NULL, packets BLOB NOT NULL,
  PRIMARY KEY (client, slot)) STRICT, WITHOUT ROWID;

CREATE TABLE summary (                    -- numbers of an item in `width` seconds from `start`, seconds since 1970 UTC
  item_id INTEGER NOT NULL, width INTEGER NOT NULL, start INTEGER NOT NULL,
  n INTEGER NOT NULL, lo REAL NOT NULL, mean REAL NOT NULL, hi REAL NOT NULL, last REAL NOT NULL,
  PRIMARY KEY (item_id, width, start)) STRICT, WITHOUT ROWID;

CREATE TABLE mqtt_noted (                 -- what a writer knows of its broker
  client TEXT NOT NULL, name TEXT NOT NULL, value INTEGER NOT NULL, PRIMARY KEY (client, name)) STRICT, WITHOUT ROWID;
