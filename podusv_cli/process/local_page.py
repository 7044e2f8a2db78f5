"""A page for this machine alone: HTTP on the loopback interface, answered by the main thread.

Simulations want the main thread, where Ctrl-C reaches them; threads of the server only carry.
"""

from __future__ import annotations

import json
import secrets
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

HOST = "127.0.0.1"
GLANCE = 0.2  # s between two looks at signals
MOST = 65536  # bytes of a question
HEADERS = {
    "Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff", "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src "
    "'unsafe-inline'; connect-src 'self'; img-src data:; form-action 'none'; base-uri 'none'; "
    "frame-ancestors 'none'",
}  # fmt: skip
Answer = Callable[[str, Mapping[str, Any]], Mapping[str, Any]]  # of the question's name, and it
_Job = tuple[str, Mapping[str, Any], "SimpleQueue[bytes]"]


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, port: int, page: Callable[[str], str]) -> None:
        super().__init__((HOST, port), _Handler)
        self.base = f"/{secrets.token_urlsafe(16)}/"
        self.hosts = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}
        self.page, self.jobs = page(self.base).encode(), SimpleQueue[_Job]()


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"  # one connection for many questions
    disable_nagle_algorithm = True  # else each answer waits 40 ms for an acknowledgement

    def do_GET(self) -> None:
        """The page."""
        if self._known() and self.path == self.server.base:
            self._send(self.server.page, "text/html; charset=utf-8")

    def do_POST(self) -> None:
        """An answer of the main thread."""
        size = int(self.headers.get("Content-Length") or 0)
        if not (self._known() and size <= MOST):
            return
        kind, origin = self.headers.get("Content-Type"), self.headers.get("Origin")
        if kind != "application/json" or (origin and origin[7:] not in self.server.hosts):
            self.send_error(403)
            return
        answer: SimpleQueue[bytes] = SimpleQueue()
        try:
            asked = json.loads(self.rfile.read(size))
        except ValueError:
            self.send_error(400)
            return
        self.server.jobs.put((self.path.removeprefix(self.server.base), asked, answer))
        self._send(answer.get(), "application/json")

    def _known(self) -> bool:
        """Whether it is asked under its own name, which a page elsewhere cannot do, and token."""
        known = self.headers.get("Host") in self.server.hosts
        if not (
            known and secrets.compare_digest(self.path[: len(self.server.base)], self.server.base)
        ):
            self.close_connection = True
            self.send_error(404)
            return False
        return True

    def _send(self, content: bytes, kind: str) -> None:
        self.send_response(200)
        for name, text in {**HEADERS, "Content-Type": kind, "Content-Length": len(content)}.items():
            self.send_header(name, str(text))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: object) -> None:
        """Nothing: the terminal is the user's."""


def serve(
    page: Callable[[str], str], answer: Answer, started: Callable[[str], None], port: int = 0
) -> None:
    """Serve a page and answer its questions one by one until Ctrl-C; `started` gets its address.

    `page` makes it, with the path under which it asks. Raises OSError where the port is taken.
    """
    with _Server(port, page) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        started(f"http://{HOST}:{server.server_port}{server.base}")
        while True:
            try:
                name, asked, waiting = server.jobs.get(timeout=GLANCE)
            except Empty:  # a signal that comes as the wait begins would else wait for a question
                continue
            made = json.dumps(answer(name, asked), separators=(",", ":"), allow_nan=False)
            waiting.put(made.encode())
