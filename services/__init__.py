"""A smart apartment, its camera and a robot on one MQTT event bus."""
