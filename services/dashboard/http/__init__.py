"""The dashboard over HTTP: pages, their live view, orders, history, pictures.

Live by server-sent events, not a websocket: pages only listen there and order by POST, so one cookie, one Host check
and one CSRF check hold for everything, a browser connects again by itself, and no further library is needed. Browsers
allow six HTTP/1.1 connections per site; a page that is not looked at closes its own.
"""
