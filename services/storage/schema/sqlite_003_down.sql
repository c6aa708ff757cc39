-- Back to version 2, SQLite. The missions are lost: the older program neither wrote nor read any.
DROP TABLE mission;

CREATE TABLE mission (
  mission TEXT PRIMARY KEY, robot TEXT NOT NULL, marker INTEGER NOT NULL, state TEXT NOT NULL, reason TEXT,
  started INTEGER NOT NULL, ended INTEGER) STRICT, WITHOUT ROWID;
