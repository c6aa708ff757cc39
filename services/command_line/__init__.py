"""The commands by what they are about; `services/__main__.py` puts them together and has those of the whole."""
