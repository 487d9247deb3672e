"""A TCP link that can be cut: silently, as a lost radio does, or closed, as a rebooted modem does."""

import contextlib
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

BLOCK_BYTES = 65_536
LOOK_S = 0.05  # how soon a relay notices that the link is cut


class CuttableLink:
    """Relays connections to a port until it is closed; while it is cut, nothing passes in either direction."""

    def __init__(self, target_port: int) -> None:
        self._target_port = target_port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._flowing = threading.Event()
        self._flowing.set()
        self._closed = threading.Event()
        self._mutex = threading.Lock()
        self._sockets: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    @property
    def endpoint(self) -> str:
        """Where Zenoh connects to."""
        return f"tcp/127.0.0.1:{self._listener.getsockname()[1]}"

    def cut(self, *, closing: bool) -> None:
        """Nothing passes any more; with `closing` both ends are told so, else they have to notice."""
        self._flowing.clear()
        if closing:
            self._close_connections()

    def mend(self) -> None:
        """Everything passes again."""
        self._flowing.set()

    def close(self) -> None:
        """No link any more."""
        self._closed.set()
        self._flowing.set()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._close_connections()
        for thread in self._threads:
            thread.join(5.0)

    def _close_connections(self) -> None:
        with self._mutex:
            sockets, self._sockets = self._sockets, []
        for one in sockets:
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        while not self._closed.is_set():
            with contextlib.suppress(OSError):
                near, _ = self._listener.accept()
                self._relay(near, socket.create_connection(("127.0.0.1", self._target_port)))

    def _relay(self, near: socket.socket, far: socket.socket) -> None:
        with self._mutex:
            self._sockets += [near, far]
        for source, sink in ((near, far), (far, near)):
            thread = threading.Thread(target=self._pump, args=(source, sink), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _pump(self, source: socket.socket, sink: socket.socket) -> None:
        """Bytes passed on until either end is gone; both are gone then."""
        with source, contextlib.suppress(OSError):
            while self._flowing.wait(LOOK_S) or not self._closed.is_set():
                if not self._flowing.is_set():
                    continue
                data = source.recv(BLOCK_BYTES)
                if not data:
                    break
                self._flowing.wait()
                sink.sendall(data)
        with contextlib.suppress(OSError):
            sink.shutdown(socket.SHUT_RDWR)


@contextmanager
def cuttable_link(target_port: int) -> Iterator[CuttableLink]:
    """A link to a port of this machine."""
    link = CuttableLink(target_port)
    try:
        yield link
    finally:
        link.close()
