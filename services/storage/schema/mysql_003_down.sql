-- Back to version 2, MariaDB and MySQL. The missions are lost: the older program neither wrote nor read any.
DROP TABLE IF EXISTS mission;

CREATE TABLE IF NOT EXISTS mission (
  mission VARCHAR(64) NOT NULL PRIMARY KEY, robot VARCHAR(64) NOT NULL, marker INT NOT NULL,
  state VARCHAR(20) NOT NULL, reason VARCHAR(400), started TIMESTAMP(6) NOT NULL, ended TIMESTAMP(6) NULL) ENGINE=InnoDB;
