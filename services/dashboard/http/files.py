"""The page's own files, read once: what is not in the folder does not exist. Small ones go out packed."""

from __future__ import annotations

import gzip
import hashlib
from dataclasses import dataclass
from pathlib import Path

from starlette.requests import Request
from starlette.responses import Response

STATIC = Path(__file__).parents[1] / "static"
TYPES = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml", ".webmanifest": "application/manifest+json", ".txt": "text/plain; charset=utf-8",
    ".png": "image/png",
}  # fmt: skip


@dataclass(frozen=True)
class File:
    """One file, as it is and packed."""

    kind: str
    plain: bytes
    packed: bytes
    tag: str


class Files:
    """`paths`: where they are served."""

    def __init__(self, folder: Path = STATIC) -> None:
        found = sorted(file for file in folder.rglob("*") if file.suffix in TYPES)
        self._files = {f"/{file.relative_to(folder).as_posix()}": _read(file) for file in found}
        self._files["/"] = self._files["/index.html"]
        self.paths = list(self._files)

    async def serve(self, request: Request) -> Response:
        """A file; a browser that has it already is told so."""
        file = self._files[request.url.path]
        headers = {"etag": file.tag, "cache-control": "no-cache", "vary": "accept-encoding"}
        if request.headers.get("if-none-match") == file.tag:
            return Response(status_code=304, headers=headers)
        if "gzip" in request.headers.get("accept-encoding", ""):
            return Response(file.packed, 200, {**headers, "content-encoding": "gzip"}, file.kind)
        return Response(file.plain, 200, headers, file.kind)


def _read(file: Path) -> File:
    data = file.read_bytes()
    tag = f'"{hashlib.sha256(data).hexdigest()[:20]}"'
    return File(TYPES[file.suffix], data, gzip.compress(data, 9, mtime=0), tag)
