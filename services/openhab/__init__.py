"""OpenHAB's side of the apartment: its files, written from the model of the home, checked, and read back.

`generate.py` makes the files of a site (`site.py`), one module per kind of file; `check/` reads files as strictly as
OpenHAB's own grammars; `importing.py` makes a `home.yaml` of what a lab has. Not here: the bus itself; OpenHAB meets
it through the rules that are generated.
"""
