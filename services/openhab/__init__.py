"""OpenHAB's side of the apartment: its files, written from the model of the home, checked, and read back.

`generate.py` makes the files of a site (`site.py`), one module per kind of file; `check/` reads files as strictly as
OpenHAB's own grammars; `importing.py` makes a `home.yaml` of what a lab has. OpenHAB meets the bus through the rules
that are generated. Where it has no MQTT binding the service here (`mirror.py`) does it: it listens to
`home/<item>/command` and `set`, and says `home/<item>/state`.
"""

from services.openhab.mirror import Config, start

__all__ = ["Config", "start"]
