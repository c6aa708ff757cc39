"""Who the camera is (`magicBox.cgi`). Pure."""

from __future__ import annotations

from services.camera.brands.dahua.replies import read_table


def magic(action: str) -> str:
    """Asks for a fact about the device."""
    return f"/cgi-bin/magicBox.cgi?action={action}"


def read_version(body: str) -> str:
    """`version=...` with the build date on its own line, or after a comma."""
    table = read_table(body)
    version, _, build = table.get("version", "").partition(",build:")
    date = build or table.get("BuildDate", "")
    return f"{version} {date}".strip()
