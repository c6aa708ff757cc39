-- Back to version 1, MariaDB and MySQL. The means are lost; raw rows are not touched.
DROP TABLE IF EXISTS summary;
DROP TABLE IF EXISTS mqtt_noted;
DROP TABLE IF EXISTS mqtt_seen;

CREATE TABLE IF NOT EXISTS mqtt_session (
  client VARCHAR(64) NOT NULL PRIMARY KEY, writer TINYINT UNSIGNED NOT NULL UNIQUE, seen MEDIUMBLOB NOT NULL) ENGINE=InnoDB;
