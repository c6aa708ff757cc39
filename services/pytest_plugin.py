"""Fixtures for a lab's own tests."""
