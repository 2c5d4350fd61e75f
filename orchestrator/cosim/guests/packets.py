"""Objects over a socket that keeps the bounds of packets, which takes one system call each way."""

from __future__ import annotations

import socket
from pickle import dumps, loads
from typing import Any

PACKET = 1 << 16  # bytes
_MORE, _LAST = b"+", b"."  # first byte of a packet


def pair() -> tuple[socket.socket, socket.socket]:
    """Two connected ends."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


def send(end: socket.socket, content: Any) -> None:
    """Send an object; raises OSError if the other end is closed."""
    data = dumps(content)
    while len(data) > PACKET:
        end.sendall(_MORE + data[:PACKET])
        data = data[PACKET:]
    end.sendall(_LAST + data)


def receive(end: socket.socket) -> Any:
    """Receive an object; raises EOFError if the other end is closed, OSError."""
    parts = []
    while True:
        packet = end.recv(PACKET + 1)
        if not packet:
            raise EOFError
        parts.append(packet[1:])
        if packet[:1] == _LAST:
            return loads(b"".join(parts) if len(parts) > 1 else parts[0])
