-- Version 2, MariaDB and MySQL: what keeps a redelivered message from being stored twice, and means of closed intervals.
DROP TABLE IF EXISTS mqtt_session;

CREATE TABLE IF NOT EXISTS mqtt_seen (    -- per writer and turn: packet ids and checksums of what the turn handled
  client VARCHAR(64) NOT NULL, slot SMALLINT UNSIGNED NOT NULL, turn BIGINT UNSIGNED NOT NULL, packets MEDIUMBLOB NOT NULL,
  PRIMARY KEY (client, slot)) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS summary (      -- numbers of an item in `width` seconds from `start`, seconds since 1970 UTC
  item_id INT UNSIGNED NOT NULL, width INT UNSIGNED NOT NULL, start BIGINT NOT NULL,
  n INT UNSIGNED NOT NULL, lo DOUBLE NOT NULL, mean DOUBLE NOT NULL, hi DOUBLE NOT NULL, last DOUBLE NOT NULL,
  PRIMARY KEY (item_id, width, start)) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS mqtt_noted (   -- what a writer knows of its broker
  client VARCHAR(64) NOT NULL, name VARCHAR(20) NOT NULL, value BIGINT NOT NULL, PRIMARY KEY (client, name)) ENGINE=InnoDB;
