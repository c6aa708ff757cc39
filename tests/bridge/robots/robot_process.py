"""The simulated robot's ROS nodes as a program of their own; ends with the end of its standard input."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

from services.simulators.robot import Config, start

FOLDER = Path(__file__).parents[3] / "config"


def main() -> None:
    logging.basicConfig(level=logging.WARNING)
    config = Config(folder=FOLDER, world=Path("world.yaml"), places=Path("tiago/robot_places.yaml"), on_bus=False)
    with start(config, lambda _: None):
        sys.stdin.read()


if __name__ == "__main__":
    main()
