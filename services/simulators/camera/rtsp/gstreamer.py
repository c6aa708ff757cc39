"""GStreamer as far as the camera needs it; importing this fails with ImportError, saying what to install.

GStreamer calls us on threads of its own. What it calls must not ask Python which thread that is (starting a thread
and logging do): Python would keep a record of a thread that it never sees end.
"""

from __future__ import annotations

import warnings

INSTALL = "apt-get install python3-gi gir1.2-gst-rtsp-server-1.0 gstreamer1.0-plugins-base gstreamer1.0-plugins-good "
INSTALL += "gstreamer1.0-plugins-ugly"
NEEDED = ("appsrc", "x264enc", "rtph264pay", "rtppcmapay")

with warnings.catch_warnings():  # the binding's own importer is of an old kind
    warnings.simplefilter("ignore", ImportWarning)
    try:
        import gi

        for name in ("Gst", "GstRtsp", "GstRtspServer"):
            gi.require_version(name, "1.0")
        from gi.repository import GLib, Gst, GstRtsp, GstRtspServer
    except (ImportError, ValueError) as missing:
        raise ImportError(f"{missing}; {INSTALL}") from missing

Gst.init(None)
if lacking := [name for name in NEEDED if Gst.ElementFactory.find(name) is None]:
    raise ImportError(f"GStreamer has no {', '.join(lacking)}; {INSTALL}")

__all__ = ["GLib", "Gst", "GstRtsp", "GstRtspServer"]
