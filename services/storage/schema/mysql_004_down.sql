-- Back to version 3, MariaDB and MySQL. Of orders and missions with the same id the newest is kept.
DROP TABLE IF EXISTS camera_order_3;

CREATE TABLE camera_order_3 (
  order_id VARCHAR(64) NOT NULL PRIMARY KEY, camera VARCHAR(64) NOT NULL, name VARCHAR(20) NOT NULL,
  value VARCHAR(400) NOT NULL, state VARCHAR(12) NOT NULL, error VARCHAR(400), at TIMESTAMP(6) NOT NULL) ENGINE=InnoDB;

REPLACE INTO camera_order_3 (order_id, camera, name, value, state, error, at)
  SELECT order_id, camera, name, value, state, error, at FROM camera_order ORDER BY at;

DROP TABLE camera_order;

RENAME TABLE camera_order_3 TO camera_order;

DROP TABLE IF EXISTS mission_3;

CREATE TABLE mission_3 (
  mission VARCHAR(64) NOT NULL PRIMARY KEY, robot VARCHAR(64) NOT NULL, marker INT NOT NULL,
  state VARCHAR(20) NOT NULL, reason VARCHAR(400), place VARCHAR(200), x DOUBLE, y DOUBLE, z DOUBLE,
  seen_by VARCHAR(64), started TIMESTAMP(6) NOT NULL, ended TIMESTAMP(6) NULL, story MEDIUMTEXT NULL,
  KEY (robot, started)) ENGINE=InnoDB;

REPLACE INTO mission_3 (mission, robot, marker, state, reason, place, x, y, z, seen_by, started, ended, story)
  SELECT mission, robot, marker, state, reason, place, x, y, z, seen_by, started, ended, story FROM mission
  ORDER BY started;

DROP TABLE mission;

RENAME TABLE mission_3 TO mission;
