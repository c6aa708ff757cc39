"""Dahua's HTTP API (CGI), which Amcrest speaks too: requests and replies as functions, nothing is sent from here.

Firmware differs much: both spellings of Position, several forms of status, version and error, channel 0 or 1.
"""
