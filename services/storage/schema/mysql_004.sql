-- Version 4, MariaDB and MySQL: an id may be used again, by another camera or robot and on another day; `a` is not `A`.
ALTER TABLE camera_order MODIFY order_id VARCHAR(64) CHARACTER SET utf8mb4 COLLATE utf8mb4_bin NOT NULL,
  DROP PRIMARY KEY, ADD PRIMARY KEY (camera, order_id, at);

ALTER TABLE mission MODIFY mission VARCHAR(64) CHARACTER SET utf8mb4 COLLATE utf8mb4_bin NOT NULL,
  DROP PRIMARY KEY, ADD PRIMARY KEY (robot, mission, started);
