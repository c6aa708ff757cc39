"""The simulated camera's ONVIF side (Profile S), from the ONVIF specifications, on the motors of its CGI side.

`service` answers a message; `soap` reads, checks and frames it; `motors` is the PTZ service.
"""
