-- Version 1, SQLite. Times are whole microseconds since 1970, UTC; the views show local time, as OpenHAB's tables do.
CREATE TABLE schema_version (version INTEGER PRIMARY KEY, applied INTEGER NOT NULL, note TEXT NOT NULL) STRICT;

CREATE TABLE kind (                       -- how an item type is stored and exported
  kind TEXT PRIMARY KEY, holds TEXT NOT NULL CHECK (holds IN ('num','text')),
  jdbc_type TEXT NOT NULL, mysql1_type TEXT NOT NULL) STRICT, WITHOUT ROWID;

CREATE TABLE item (                       -- not "items", which is one name with the view Items here
  item_id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL UNIQUE, kind TEXT NOT NULL, unit TEXT) STRICT;

CREATE TABLE sample (
  item_id INTEGER NOT NULL, time INTEGER NOT NULL,
  num REAL, text TEXT,                    -- 'UNDEF' and 'NULL' in text with num NULL are the special states
  PRIMARY KEY (item_id, time)) STRICT, WITHOUT ROWID;

CREATE TABLE sighting (
  sighting_id INTEGER PRIMARY KEY, scan TEXT NOT NULL, camera TEXT NOT NULL, marker INTEGER NOT NULL, dictionary TEXT NOT NULL,
  place TEXT, stamp INTEGER NOT NULL, first_seen INTEGER, x REAL, y REAL, z REAL, qx REAL, qy REAL, qz REAL, qw REAL,
  sx REAL, sy REAL, sz REAL, distance REAL, zoom REAL, frames INTEGER, mode TEXT, why TEXT,
  UNIQUE (scan, camera, marker, stamp)) STRICT;
CREATE INDEX sighting_marker ON sighting (marker, stamp);

CREATE TABLE scan (
  scan TEXT PRIMARY KEY, camera TEXT NOT NULL, state TEXT NOT NULL, targets TEXT NOT NULL, found TEXT NOT NULL,
  started INTEGER NOT NULL, ended INTEGER, frames_taken INTEGER, frames_analysed INTEGER) STRICT, WITHOUT ROWID;

CREATE TABLE mission (
  mission TEXT PRIMARY KEY, robot TEXT NOT NULL, marker INTEGER NOT NULL, state TEXT NOT NULL, reason TEXT,
  started INTEGER NOT NULL, ended INTEGER) STRICT, WITHOUT ROWID;

CREATE TABLE camera_order (
  order_id TEXT PRIMARY KEY, camera TEXT NOT NULL, name TEXT NOT NULL, value TEXT NOT NULL, state TEXT NOT NULL,
  error TEXT, at INTEGER NOT NULL) STRICT, WITHOUT ROWID;

CREATE TABLE diagnostic (                 -- changes only
  component TEXT NOT NULL, time INTEGER NOT NULL, level INTEGER NOT NULL, message TEXT NOT NULL, details TEXT,
  PRIMARY KEY (component, time)) STRICT, WITHOUT ROWID;

CREATE TABLE mqtt_session (client TEXT PRIMARY KEY, writer INTEGER NOT NULL UNIQUE, seen BLOB NOT NULL) STRICT, WITHOUT ROWID;

CREATE VIEW "Items" AS SELECT item_id AS ItemId, name AS ItemName FROM item;

INSERT INTO kind (kind, holds, jdbc_type, mysql1_type) VALUES
  ('Call', 'text', 'VARCHAR(200)', 'VARCHAR(200)'),
  ('Color', 'text', 'VARCHAR(70)', 'VARCHAR(70)'),
  ('Contact', 'text', 'VARCHAR(6)', 'VARCHAR(6)'),
  ('DateTime', 'text', 'TIMESTAMP(3)', 'DATETIME'),
  ('Dimmer', 'num', 'TINYINT', 'TINYINT'),
  ('Image', 'text', 'VARCHAR(16255)', 'VARCHAR(20000)'),
  ('Location', 'text', 'VARCHAR(50)', 'VARCHAR(30)'),
  ('Number', 'num', 'DOUBLE', 'DOUBLE'),
  ('Player', 'text', 'VARCHAR(20)', 'VARCHAR(20000)'),
  ('Rollershutter', 'num', 'TINYINT', 'TINYINT'),
  ('String', 'text', 'VARCHAR(16255)', 'VARCHAR(20000)'),
  ('Switch', 'text', 'VARCHAR(6)', 'CHAR(3)');
