"""A Zenoh router that knows who may do what: rules from the authority's register, anew whenever that changes."""

import json
import logging
import threading
import time
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
OPEN_TRIES, OPEN_WAIT_S = 20, 0.1  # for the endpoint of the session before this one to be free

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

    Raises InputError for a register or certificate that cannot be, ServiceError where an endpoint cannot be had.
    """

    def __init__(self, settings: RouterSettings, *, root: str, tell: Callable[[Told], None]) -> None:
        self._settings, self._root = settings, root
        self._access = self._access_now()
        reader = RefusalReader()

        def hear(piece: bytes) -> None:
            for one in reader.read(piece):
                tell(one)

        self._tap = LogTap(TRACED if settings.refusals_named else UNTRACED, hear)
        try:
            self._session = self._opened()
        except ServiceError:
            self._tap.close()
            raise
        self._closed = False

    @property
    def ready(self) -> bool:
        """Whether its endpoints are open."""
        return not self._closed

    def run(self, stop: threading.Event) -> None:
        """Passes on until told to stop; a changed register takes effect within `LOOK_S`.

        Raises ServiceError where the endpoint cannot be had again.
        """
        while not stop.wait(LOOK_S):
            self.look()

    def look(self) -> None:
        """The rules of the register as it is now; all sessions end when they changed, and come back under the new ones.

        A register that cannot be read is logged, and the rules stay.
        """
        try:
            access = self._access_now()
        except InputError as error:
            logger.error("the rules stay as they were: %s", error)
            return
        if access != self._access:
            self._access = access
            self._session.close()  # type: ignore[no-untyped-call]
            self._session = self._opened()
            logger.info("rules changed", extra={"names": len(access["subjects"]) if access else 0})

    def close(self) -> None:
        """The session ended; again: no effect."""
        if not self._closed:
            self._closed = True
            if not self._session.is_closed():  # it is, where it could not be opened anew
                self._session.close()  # type: ignore[no-untyped-call]
            self._tap.close()

    def _access_now(self) -> dict[str, Any] | None:
        path = self._settings.register_file
        return None if path is None else access_control(read_register(path), root=self._root)

    def _opened(self) -> zenoh.Session:
        config = router_config(self._settings, self._access)
        for attempt in range(1, OPEN_TRIES + 1):
            try:
                return zenoh.open(config)
            except zenoh.ZError as error:
                if attempt == OPEN_TRIES:
                    raise ServiceError(f"no router on {', '.join(self._settings.listen)}: {error}") from error
                time.sleep(OPEN_WAIT_S)
        raise AssertionError("unreachable: the last attempt returns or raises")
