"""Puts the apartment on a machine: systemd's units from the registry, users, folders, the broker's files.

Not here: passwords and certificates (`services/credentials/`), what a service does.
"""
