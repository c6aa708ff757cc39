-- Back to version 3, MariaDB and MySQL. Of orders and missions with the same id the newest is kept.
-- It may end anywhere and begin again: at each moment the table of the real name is there, and has all rows.
DROP TABLE IF EXISTS camera_order_3, camera_order_4;

CREATE TABLE camera_order_3 (
  order_id VARCHAR(64) NOT NULL PRIMARY KEY, camera VARCHAR(64) NOT NULL, name VARCHAR(20) NOT NULL,
  value VARCHAR(400) NOT NULL, state VARCHAR(12) NOT NULL, error VARCHAR(400), at TIMESTAMP(6) NOT NULL) ENGINE=InnoDB;

REPLACE INTO camera_order_3 (order_id, camera, name, value, state, error, at)
  SELECT order_id, camera, name, value, state, error, at FROM camera_order ORDER BY at;

RENAME TABLE camera_order TO camera_order_4, camera_order_3 TO camera_order;

DROP TABLE camera_order_4;

DROP TABLE IF EXISTS mission_3, mission_4;

CREATE TABLE mission_3 (
  mission VARCHAR(64) NOT NULL PRIMARY KEY, robot VARCHAR(64) NOT NULL, marker INT NOT NULL,
  state VARCHAR(20) NOT NULL, reason VARCHAR(400), place VARCHAR(200), x DOUBLE, y DOUBLE, z DOUBLE,
  seen_by VARCHAR(64), started TIMESTAMP(6) NOT NULL, ended TIMESTAMP(6) NULL, story MEDIUMTEXT NULL,
  KEY (robot, started)) ENGINE=InnoDB;

REPLACE INTO mission_3 (mission, robot, marker, state, reason, place, x, y, z, seen_by, started, ended, story)
  SELECT mission, robot, marker, state, reason, place, x, y, z, seen_by, started, ended, story FROM mission
  ORDER BY started;

RENAME TABLE mission TO mission_4, mission_3 TO mission;

DROP TABLE mission_4;
