"""The network to the simulated camera without a network: an HTTP transport whose answers take virtual time.

The camera behind it is the simulator's own inside; the real wire is `simulators/camera/http.py`.
"""

from __future__ import annotations

import httpx

from services.simulators.camera.messages import read
from services.simulators.camera.program import Inside


class Wire(httpx.BaseTransport):
    """`now` goes on with every request, by the time that the camera takes for it."""

    def __init__(self, inside: Inside) -> None:
        self.inside = inside
        self.now = 0.0

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """One request and its answer; authentication as on the real wire. A camera that restarts refuses."""
        if self.inside.device.booting(self.now):
            raise httpx.ConnectError("connection refused", request=request)
        target = request.url.raw_path.decode()
        verdict = self.inside.door.judge(request.method, target, request.headers.get("Authorization"), self.now)
        if not verdict.passed:
            challenges = [("WWW-Authenticate", challenge) for challenge in verdict.challenges]
            return httpx.Response(401, headers=challenges, content=verdict.body)
        return self._picture() if "/snapshot.cgi" in target else self._control(target)

    def _picture(self) -> httpx.Response:
        self.now += self.inside.device.latency.snapshot()
        content = self.inside.pictures.jpeg("MainFormat", self.now)
        return httpx.Response(200, headers={"Content-Type": "image/jpeg"}, content=content)

    def _control(self, target: str) -> httpx.Response:
        """A request acts when it has been processed."""
        self.now += self.inside.device.latency.control(self.now)
        answer = self.inside.device.answer(read(target), self.now)
        return httpx.Response(answer.status, headers={"Content-Type": answer.content_type}, content=answer.body)
