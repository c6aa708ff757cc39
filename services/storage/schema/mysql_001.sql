-- Version 1, MariaDB and MySQL. Views with OpenHAB's layout are made by mysql.py in a database of their own.
-- Every statement may be run again: DDL is not part of a transaction here, so a migration may stop in between.
CREATE TABLE IF NOT EXISTS schema_version (
  version INT NOT NULL PRIMARY KEY, applied TIMESTAMP(6) NOT NULL, note VARCHAR(200) NOT NULL) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS kind (         -- how an item type is stored and exported
  kind VARCHAR(20) CHARACTER SET ascii NOT NULL PRIMARY KEY,
  holds ENUM('num','text') NOT NULL,      -- which column of sample carries the value
  jdbc_type VARCHAR(20) NOT NULL, mysql1_type VARCHAR(20) NOT NULL) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS item (         -- not "items", which SQLite and lower_case_table_names=1 fold into the view Items
  item_id INT UNSIGNED NOT NULL AUTO_INCREMENT PRIMARY KEY,
  name VARCHAR(200) CHARACTER SET ascii COLLATE ascii_bin NOT NULL UNIQUE,
  kind VARCHAR(20) CHARACTER SET ascii NOT NULL, unit VARCHAR(32) NULL) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS sample (
  item_id INT UNSIGNED NOT NULL,
  time TIMESTAMP(6) NOT NULL,             -- UTC inside, shown in the session's time_zone
  num DOUBLE NULL, text MEDIUMTEXT NULL,  -- 'UNDEF' and 'NULL' in text with num NULL are the special states
  PRIMARY KEY (item_id, time)) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS sighting (
  sighting_id BIGINT UNSIGNED NOT NULL AUTO_INCREMENT PRIMARY KEY,
  scan VARCHAR(64) NOT NULL, camera VARCHAR(64) NOT NULL, marker INT NOT NULL, dictionary VARCHAR(40) NOT NULL,
  place VARCHAR(100) NULL, stamp TIMESTAMP(6) NOT NULL, first_seen TIMESTAMP(6) NULL,
  x DOUBLE, y DOUBLE, z DOUBLE, qx DOUBLE, qy DOUBLE, qz DOUBLE, qw DOUBLE, sx DOUBLE, sy DOUBLE, sz DOUBLE,
  distance DOUBLE, zoom DOUBLE, frames INT, mode VARCHAR(10), why VARCHAR(200),
  UNIQUE (scan, camera, marker, stamp), KEY (marker, stamp)) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS scan (
  scan VARCHAR(64) NOT NULL PRIMARY KEY, camera VARCHAR(64) NOT NULL, state VARCHAR(12) NOT NULL,
  targets VARCHAR(400) NOT NULL, found VARCHAR(400) NOT NULL, started TIMESTAMP(6) NOT NULL, ended TIMESTAMP(6) NULL,
  frames_taken INT, frames_analysed INT, KEY (camera, started)) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS mission (
  mission VARCHAR(64) NOT NULL PRIMARY KEY, robot VARCHAR(64) NOT NULL, marker INT NOT NULL,
  state VARCHAR(20) NOT NULL, reason VARCHAR(400), started TIMESTAMP(6) NOT NULL, ended TIMESTAMP(6) NULL) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS camera_order (
  order_id VARCHAR(64) NOT NULL PRIMARY KEY, camera VARCHAR(64) NOT NULL, name VARCHAR(20) NOT NULL,
  value VARCHAR(400) NOT NULL, state VARCHAR(12) NOT NULL, error VARCHAR(400), at TIMESTAMP(6) NOT NULL) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS diagnostic (   -- changes only
  component VARCHAR(200) NOT NULL, time TIMESTAMP(6) NOT NULL, level TINYINT NOT NULL,
  message VARCHAR(1000) NOT NULL, details MEDIUMTEXT NULL, PRIMARY KEY (component, time)) ENGINE=InnoDB;

CREATE TABLE IF NOT EXISTS mqtt_session (
  client VARCHAR(64) NOT NULL PRIMARY KEY, writer TINYINT UNSIGNED NOT NULL UNIQUE,
  seen MEDIUMBLOB NOT NULL) ENGINE=InnoDB; -- (packet id, crc32) of the last window, in the same transaction as the rows

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
  ('Switch', 'text', 'VARCHAR(6)', 'CHAR(3)')
  ON DUPLICATE KEY UPDATE holds=VALUES(holds), jdbc_type=VALUES(jdbc_type), mysql1_type=VALUES(mysql1_type);
