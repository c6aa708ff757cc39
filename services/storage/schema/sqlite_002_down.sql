-- Back to version 1, SQLite. The means are lost; raw rows are not touched.
DROP TABLE summary;
DROP TABLE mqtt_noted;
DROP TABLE mqtt_seen;

CREATE TABLE mqtt_session (client TEXT PRIMARY KEY, writer INTEGER NOT NULL UNIQUE, seen BLOB NOT NULL) STRICT, WITHOUT ROWID;
