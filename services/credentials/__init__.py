"""Makes the secrets of an installation: passwords, the broker's password file, a small certificate authority.

Not here: where a running service finds its secrets (`secret_store.py`), who may do what at the broker (`access.py`).
"""
