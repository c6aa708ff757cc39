-- Version 3, SQLite: missions with their place, position and story. Nothing was written to the table before.
DROP TABLE mission;

CREATE TABLE mission (
  mission TEXT PRIMARY KEY, robot TEXT NOT NULL, marker INTEGER NOT NULL,
  state TEXT NOT NULL,                    -- its step while it goes on, then how it ended
  reason TEXT, place TEXT, x REAL, y REAL, z REAL, -- of the marker, in the apartment
  seen_by TEXT, started INTEGER NOT NULL, ended INTEGER,
  story TEXT                              -- JSON: [[seconds since it began, step, text], ...]
) STRICT, WITHOUT ROWID;
