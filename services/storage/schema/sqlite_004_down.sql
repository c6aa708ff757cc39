-- Back to version 3, SQLite. Of orders and missions with the same id the newest is kept.
ALTER TABLE camera_order RENAME TO camera_order_4;

CREATE TABLE camera_order (
  order_id TEXT PRIMARY KEY, camera TEXT NOT NULL, name TEXT NOT NULL, value TEXT NOT NULL, state TEXT NOT NULL,
  error TEXT, at INTEGER NOT NULL) STRICT, WITHOUT ROWID;

REPLACE INTO camera_order SELECT order_id, camera, name, value, state, error, at FROM camera_order_4 ORDER BY at;

DROP TABLE camera_order_4;

ALTER TABLE mission RENAME TO mission_4;

CREATE TABLE mission (
  mission TEXT PRIMARY KEY, robot TEXT NOT NULL, marker INTEGER NOT NULL, state TEXT NOT NULL,
  reason TEXT, place TEXT, x REAL, y REAL, z REAL, seen_by TEXT, started INTEGER NOT NULL, ended INTEGER,
  story TEXT) STRICT, WITHOUT ROWID;

REPLACE INTO mission SELECT mission, robot, marker, state, reason, place, x, y, z, seen_by, started, ended, story
  FROM mission_4 ORDER BY started;

DROP TABLE mission_4;
