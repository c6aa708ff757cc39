"""Who may watch: Digest as cameras do it over RTSP, without qop, with the account and the lockout of the HTTP door."""

from __future__ import annotations

from typing import Any

from services.simulators.camera.http import CameraServer
from services.simulators.camera.rtsp.gstreamer import GstRtsp, GstRtspServer

ROLE = "viewer"


class Account(GstRtspServer.RTSPAuth):  # type: ignore[misc]
    """GStreamer challenges and checks; the camera's door counts what was wrong and knows the password of now."""

    def __init__(self, camera: CameraServer) -> None:
        super().__init__()
        self._camera = camera
        self._known = ("", "")
        only_basic = camera.device.profile.auth == "basic"
        self.set_supported_methods(GstRtsp.RTSPAuthMethod.BASIC if only_basic else GstRtsp.RTSPAuthMethod.DIGEST)
        self.set_realm(camera.door.realm)

    def do_authenticate(self, context: Any) -> bool:
        """Called for each request that needs an account."""
        self._renew()
        found, header = context.request.get_header(GstRtsp.RTSPHeaderField.AUTHORIZATION, 0)
        said = header if found == GstRtsp.RTSPResult.OK else None
        method = GstRtsp.rtsp_method_as_text(context.method)
        if not self._camera.judge_viewer(method, said):
            return False
        return bool(GstRtspServer.RTSPAuth.do_authenticate(self, context))

    def _renew(self) -> None:
        """The account may have been changed since."""
        if self._known == self._camera.door.account:
            return
        self.remove_digest(self._known[0])
        self.remove_basic(GstRtspServer.RTSPAuth.make_basic(*self._known))
        self._known = self._camera.door.account
        token = GstRtspServer.RTSPToken.new()
        token.set_string("media.factory.role", ROLE)
        self.add_digest(*self._known, token)
        self.add_basic(GstRtspServer.RTSPAuth.make_basic(*self._known), token)


def permissions() -> Any:
    """What the account may do with a stream."""
    granted = GstRtspServer.RTSPPermissions.new()
    for right in ("access", "construct"):
        granted.add_permission_for_role(ROLE, f"media.factory.{right}", True)
    return granted
