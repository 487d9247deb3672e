"""A Zenoh router that knows who may do what: rules from the authority's register, anew whenever that changes."""

import json
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import zenoh

from trigpoint.bus.access import access_control
from trigpoint.bus.log_tap import LogTap
from trigpoint.bus.refusals import TRACED, UNTRACED, RefusalReader, Told
from trigpoint.bus.register import read_register
from trigpoint.bus.zenoh_bus import ZenohSettings, session_config
from trigpoint.errors import InputError, ServiceError

LOOK_S = 0.5  # between two looks at the register
OPEN_TRIES, OPEN_LOOK_S = 20, 0.1  # until the endpoint of the session before this one is free

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class RouterSettings(ZenohSettings):
    """A router's endpoints; with `tls`, `register_file` is the authority's register, and who is not in it may do
    nothing. `refusals_named`: each refused message is logged with its sender and counted, at the price of Zenoh's
    finest log; otherwise only refused sessions are.
    """

    mode: Literal["router"] = "router"
    register_file: Path | None = None
    refusals_named: bool = True

    def __post_init__(self) -> None:
        ZenohSettings.__post_init__(self)
        if (self.tls is None) != (self.register_file is None):
            raise InputError("tls and register_file go together: rules name certificates")


def router_config(settings: RouterSettings, access: dict[str, Any] | None) -> zenoh.Config:
    """What Zenoh is told. Raises InputError for TLS files that cannot be."""
    config = session_config(settings)
    for name, value in (
        ("timestamping/enabled", {"router": False, "peer": False, "client": False}),  # stamped at the source
        ("adminspace/enabled", False),  # nobody reads or changes the router's state over the bus
        *(() if access is None else (("access_control", access),)),
    ):
        config.insert_json5(name, json.dumps(value))
    return config


class ZenohRouter:
    """A router session that passes on what may pass; `tell` hears of refusals, in a thread of its own. Close it.

    Raises InputError for a register or certificate that cannot be.
    """

    def __init__(self, settings: RouterSettings, *, root: str, tell: Callable[[Told], None]) -> None:
        self._settings, self._root = settings, root
        self._access = self._access_now()
        reader = RefusalReader()

        def hear(piece: bytes) -> None:
            for one in reader.read(piece):
                tell(one)

        self._tap = LogTap(TRACED if settings.refusals_named else UNTRACED, hear)
        self._closed = self._is_changed = False
        self._tries_left = OPEN_TRIES
        self._session: zenoh.Session | None = None
        try:
            self._open()
        except BaseException:
            self._tap.close()
            raise

    @property
    def ready(self) -> bool:
        """Whether its endpoints are open."""
        return not self._closed and self._session is not None

    def run(self, stop: threading.Event) -> None:
        """Passes on until told to stop; a changed register takes effect within `LOOK_S`.

        Raises ServiceError where the endpoint cannot be had.
        """
        while not stop.wait(LOOK_S if self._session is not None else OPEN_LOOK_S):
            self.look()

    def look(self) -> None:
        """The rules of the register as it is now; all sessions end when they changed, and come back under the new ones.

        A register that cannot be read is logged, and the rules stay. Raises ServiceError where the endpoint cannot be
        had, after some looks.
        """
        access = self._access_readable()
        if access != self._access:
            self._access, self._is_changed = access, True
            self._end_session()
            self._tries_left = OPEN_TRIES
        if self._session is None:
            self._open()
        if self._session is not None and self._is_changed:
            self._is_changed = False
            logger.info("rules changed", extra={"names": len(access["subjects"]) if access else 0})

    def close(self) -> None:
        """The session ended; again: no effect."""
        if not self._closed:
            self._closed = True
            self._end_session()
            self._tap.close()

    def _end_session(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.close()  # type: ignore[no-untyped-call]

    def _access_readable(self) -> dict[str, Any] | None:
        """The rules of the register, or those before where it cannot be read."""
        try:
            return self._access_now()
        except InputError as error:
            logger.error("the rules stay as they were: %s", error)
            return self._access

    def _access_now(self) -> dict[str, Any] | None:
        path = self._settings.register_file
        return None if path is None else access_control(read_register(path), root=self._root)

    def _open(self) -> None:
        """A session opened if the endpoint is free, or else at the next look. Raises ServiceError at the last."""
        self._tries_left -= 1
        try:
            self._session = zenoh.open(router_config(self._settings, self._access))
        except zenoh.ZError as error:
            if self._tries_left <= 0:
                raise ServiceError(f"no router on {', '.join(self._settings.listen)}: {error}") from error
