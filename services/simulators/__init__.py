"""The apartment without hardware: what stands where (`world`), and the programs that behave like its devices."""
