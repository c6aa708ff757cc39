-- Version 3, MariaDB and MySQL: missions with their place, position and story. Nothing was written to the table before.
DROP TABLE IF EXISTS mission;

CREATE TABLE IF NOT EXISTS mission (
  mission VARCHAR(64) NOT NULL PRIMARY KEY, robot VARCHAR(64) NOT NULL, marker INT NOT NULL,
  state VARCHAR(20) NOT NULL,             -- its step while it goes on, then how it ended
  reason VARCHAR(400), place VARCHAR(200), x DOUBLE, y DOUBLE, z DOUBLE, -- of the marker, in the apartment
  seen_by VARCHAR(64), started TIMESTAMP(6) NOT NULL, ended TIMESTAMP(6) NULL,
  story MEDIUMTEXT NULL,                  -- JSON: [[seconds since it began, step, text], ...]
  KEY (robot, started)) ENGINE=InnoDB;
