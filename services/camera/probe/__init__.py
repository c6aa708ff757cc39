"""First contact with a camera: finds out what it is and how its firmware behaves, without harm.

From outside in: `command` (what a user starts), `contact` (the order of things), `login`, `firmware`, `stream`, `video`
and `turning` (each asks some questions; `turner` runs the motors), `wire` (sends and remembers). What was found is a
`findings.Findings`, with what the account may do (`rights`) and which known firmware it is like (`likeness`); `paper`
and `anonymous` make files of it, `show` the text on a terminal. It is made for cameras with Dahua's HTTP API; of others
that speak ONVIF it tells less (`onvif`).
"""
