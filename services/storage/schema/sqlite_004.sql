-- Version 4, SQLite: an id may be used again, by another camera or robot and on another day.
ALTER TABLE camera_order RENAME TO camera_order_3;

CREATE TABLE camera_order (
  order_id TEXT NOT NULL, camera TEXT NOT NULL, name TEXT NOT NULL, value TEXT NOT NULL, state TEXT NOT NULL,
  error TEXT, at INTEGER NOT NULL,        -- its first state's time
  PRIMARY KEY (camera, order_id, at)) STRICT, WITHOUT ROWID;

INSERT INTO camera_order SELECT order_id, camera, name, value, state, error, at FROM camera_order_3;

DROP TABLE camera_order_3;

ALTER TABLE mission RENAME TO mission_3;

CREATE TABLE mission (
  mission TEXT NOT NULL, robot TEXT NOT NULL, marker INTEGER NOT NULL,
  state TEXT NOT NULL,                    -- its step while it goes on, then how it ended
  reason TEXT, place TEXT, x REAL, y REAL, z REAL, -- of the marker, in the apartment
  seen_by TEXT, started INTEGER NOT NULL, ended INTEGER,
  story TEXT,                             -- JSON: [[seconds since it began, step, text], ...]
  PRIMARY KEY (robot, mission, started)) STRICT, WITHOUT ROWID;

INSERT INTO mission SELECT mission, robot, marker, state, reason, place, x, y, z, seen_by, started, ended, story
  FROM mission_3;

DROP TABLE mission_3;
