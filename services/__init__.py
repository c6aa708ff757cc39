"""A smart apartment, its camera and a robot on one MQTT event bus.

    topics/, payloads/, states what travels on the bus
    bus/                       the bus itself
    apartment/, config         what people configure
    runner, supervisor         how a service lives
    camera/, vision/           the camera and its pictures
    bridge/, ros/              ROS 1
    persistence/, storage/     what is kept
    simulators/                a home and a camera that are not there
    peers/                     private brokers, databases and ROS masters for demo, tests and benchmarks

`registry.py` is the table of services, `__main__.py` the command line.
"""

__version__ = "0.1.0"
