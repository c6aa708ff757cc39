"""ROS 1 as everybody here meets it: the master that comes and goes, and a process that becomes a node."""
