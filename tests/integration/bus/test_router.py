"""A router whose endpoint is taken for a while, or for good."""

import socket
import threading
from contextlib import closing

import pytest

from trigpoint.bus.router import RouterSettings, ZenohRouter
from trigpoint.errors import ServiceError


def router_on(port: int) -> ZenohRouter:
    return ZenohRouter(RouterSettings(listen=(f"tcp/127.0.0.1:{port}",)), root="trigpoint", tell=lambda told: None)


def test_a_router_is_ready_at_the_first_look_after_its_endpoint_is_free() -> None:
    holder = socket.create_server(("127.0.0.1", 0))
    with closing(router_on(holder.getsockname()[1])) as router:
        assert not router.ready
        holder.close()
        router.look()
        assert router.ready


def test_a_router_whose_endpoint_stays_taken_ends_with_its_name() -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as holder,
        closing(router_on(holder.getsockname()[1])) as router,
        pytest.raises(ServiceError, match=f"no router on tcp/127.0.0.1:{holder.getsockname()[1]}"),
    ):
        router.run(threading.Event())
