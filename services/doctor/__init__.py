"""Looks whether everything that an apartment needs is as it should be, and names the mend of what is not.

It changes nothing that lasts: one kept message comes and goes at the broker, and each camera is logged in to once.
"""
