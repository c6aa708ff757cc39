"""Logging in and out, and what a page must know of its session."""

from __future__ import annotations

import asyncio
import logging
import secrets
import time

from pydantic import BaseModel, Field
from starlette.responses import JSONResponse, Response

from services import __version__
from services.dashboard import passwords
from services.dashboard.house import House
from services.dashboard.http.endpoint import Asked, Body, Endpoint, fault
from services.dashboard.http.guard import cookie_name
from services.dashboard.settings import Role

log = logging.getLogger(__name__)
AT_ONCE = 2  # passwords that are checked at the same time: each takes 32 MiB and a tenth of a second


class Login(Body):
    """Name and password."""

    user: str = Field(max_length=100)
    password: str = Field(max_length=1000)


class Told(BaseModel):
    """Who somebody is here. `csrf` goes into the header `X-CSRF-Token` of every POST."""

    user: str | None
    role: Role | None
    csrf: str | None
    login: bool = Field(description="Whether there are users to log in as.")
    version: str = __version__


def endpoints(house: House) -> list[Endpoint]:
    """The rows."""
    door = Door(house)
    return [
        Endpoint("GET", "/api/session", "anybody", "Who am I, and which token do my requests carry?", door.told,
                 answer=Told),
        Endpoint("POST", "/api/login", "anybody", "Log in; the answer sets the cookie.", door.login, Login, Told),
        Endpoint("POST", "/api/logout", "anybody", "Log out.", door.logout, answer=Told),
    ]  # fmt: skip


class Door:
    """See the module."""

    def __init__(self, house: House) -> None:
        self.house = house
        self._checking = asyncio.Semaphore(AT_ONCE)

    async def told(self, asked: Asked) -> Told:
        """Who somebody is here."""
        session = asked.session
        has_users = bool(self.house.config.users)
        if session is None:
            return Told(user=None, role=None, csrf=None, login=has_users)
        return Told(user=session.user, role=session.role, csrf=session.csrf, login=has_users)

    async def login(self, asked: Asked) -> Response:
        """Checks the password; who was wrong often waits. A new session each time: nobody can give one to another."""
        name, where = asked.body.user, _where(asked)
        house, now = self.house, time.time()
        wait = max(house.tries.wait_s(who, now) for who in (f"user {name}", where))
        if wait > 0:
            return fault(429, f"too many wrong passwords: again in {wait:.0f} s", {"retry-after": f"{wait + 1:.0f}"})
        user = house.config.users.get(name)
        known = user.password.get_secret_value() if user else passwords.NOBODY
        house.tries.wrong(f"user {name}", now)  # before the check: who asks many times at once waits too
        house.tries.wrong(where, now)
        async with self._checking:
            good = await asyncio.to_thread(passwords.matches, asked.body.password, known)
        if user is None or not good:
            log.warning("wrong name or password from %s", where)
            return fault(401, "wrong name or password")
        house.tries.right(f"user {name}")
        house.tries.right(where)
        house.sessions.end(asked.token)
        token = secrets.token_urlsafe(32)
        session = house.sessions.begin(token, secrets.token_urlsafe(24), name, user.role, now)
        told = Told(user=name, role=session.role, csrf=session.csrf, login=True)
        answer = JSONResponse(told.model_dump())
        answer.set_cookie(
            cookie_name(house), token, path="/", secure=house.config.tls is not None, httponly=True, samesite="strict"
        )
        return answer

    async def logout(self, asked: Asked) -> Response:
        """Ends the session."""
        self.house.sessions.end(asked.token)
        answer = JSONResponse(Told(user=None, role=None, csrf=None, login=bool(self.house.config.users)).model_dump())
        answer.delete_cookie(
            cookie_name(self.house), path="/", secure=self.house.config.tls is not None, httponly=True,
            samesite="strict",
        )  # fmt: skip
        return answer


def _where(asked: Asked) -> str:
    client = asked.request.client
    return client.host if client else "nowhere"
