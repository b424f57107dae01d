"""A way to the studio through another port, as `ssh -L` makes one."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Thread


@contextmanager
def forwarded(port: int) -> Iterator[int]:
    """A free port of the loopback address whose connections all go on to another one."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        Thread(target=_accept, args=(listener, port), daemon=True).start()
        yield listener.getsockname()[1]


def _accept(listener: socket.socket, port: int) -> None:
    with suppress(OSError):  # the listener is closed: it was the end
        while True:
            near, _ = listener.accept()
            Thread(target=_connect, args=(near, port), daemon=True).start()


def _connect(near: socket.socket, port: int) -> None:
    with near, suppress(OSError), socket.create_connection(("127.0.0.1", port)) as far:
        there = Thread(target=_pass, args=(near, far), daemon=True)
        there.start()
        _pass(far, near)
        there.join()


def _pass(one: socket.socket, other: socket.socket) -> None:
    """Bytes of one to the other, until it has no more."""
    with suppress(OSError):
        while data := one.recv(65_536):
            other.sendall(data)
    with suppress(OSError):
        other.shutdown(socket.SHUT_WR)
