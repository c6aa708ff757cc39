"""What the apartment is: rooms and things, the map of its floor, where cameras hang and robots stand.

Read from the files in `config/`; nothing here moves or listens.
"""
