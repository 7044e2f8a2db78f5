"""A page for this machine alone: HTTP on the loopback interface, answered by the main thread.

Simulations want the main thread, where Ctrl-C reaches them; threads of the server only carry.
"""

from __future__ import annotations

import json
import re
import secrets
import sys
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from podusv_cli.core.errors import in_a_line

HOST = "127.0.0.1"
GLANCE = 0.2  # s between two looks at signals
MOST = 65536  # bytes of a question
TEXT = "text/plain; charset=utf-8"
HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src "
    "'unsafe-inline'; connect-src 'self'; img-src data:; form-action 'none'; base-uri 'none'; "
    "frame-ancestors 'none'",
}
Answer = Callable[[str, Mapping[str, Any]], Mapping[str, Any]]  # of the question's name, and it
_Told = tuple[int, bytes, str]  # code, content, type
_Job = tuple[str, Mapping[str, Any], "SimpleQueue[_Told]"]


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, port: int, page: Callable[[str], str]) -> None:
        """At a port of this machine, 0 for any; `page` makes the HTML for a secret path.

        The path is what keeps other users and pages of the web out.
        """
        super().__init__((HOST, port), _Handler)
        self.base = f"/{secrets.token_urlsafe(16)}/"
        self.hosts = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}
        self.page, self.jobs = page(self.base).encode(), SimpleQueue[_Job]()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Print what went wrong; nothing where the browser has left, which is no fault."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"  # one connection for many questions
    disable_nagle_algorithm = True  # else each answer waits 40 ms for an acknowledgement

    def do_GET(self) -> None:
        """Answer with the page, or refuse another address."""
        if not self._is_known():
            return
        if self.path != self.server.base:
            self._refuse(404, "there is one page here, at the address that podusv prints")
            return
        self._send(200, self.server.page, "text/html; charset=utf-8")

    def do_POST(self) -> None:
        """An answer of the main thread, which the thread of this question waits for.

        Only the page itself may ask: another page cannot send JSON without leave, nor our origin.
        """
        if not self._is_known() or (size := self._size()) is None:
            return
        # A form elsewhere can send text; for JSON a browser asks leave first, and gets none.
        kind, origin = self.headers.get("Content-Type"), self.headers.get("Origin")
        if kind != "application/json" or (origin and origin[7:] not in self.server.hosts):
            self._refuse(403, "only the page itself may ask, in JSON")
            return
        asked = _parse_question(self.rfile.read(size))
        if not isinstance(asked, dict):
            self._refuse(400, "a question must be a JSON object")
            return
        answer: SimpleQueue[_Told] = SimpleQueue()
        self.server.jobs.put((self.path.removeprefix(self.server.base), asked, answer))
        self._send(*answer.get())

    def _is_known(self) -> bool:
        """Whether it is asked under its own name, which a page elsewhere cannot do, and token.

        The token is compared in constant time. Else it is refused.
        """
        base = self.server.base.encode()
        token = self.path.encode()[: len(base)]
        known = self.headers.get("Host") in self.server.hosts
        if known and secrets.compare_digest(token, base):
            return True
        self._refuse(404, "nothing is here; take the address that podusv prints")
        return False

    def _size(self) -> int | None:
        """The bytes of a question; None, and it is refused, where that is no number or too many."""
        text = self.headers.get("Content-Length", "")
        # int() takes signs, underscores and digits of other scripts, too.
        if not re.fullmatch("[0-9]{1,18}", text):
            self._refuse(400, "Content-Length must be the bytes of a question")
        elif int(text) > MOST:
            self._refuse(413, f"a question has at most {MOST} bytes, not {text}")
        else:
            return int(text)
        return None

    def _refuse(self, code: int, sentence: str) -> None:
        """Answer with an HTTP status `code` of 400 or more and a sentence, and close."""
        self.close_connection = True  # what is left of the question is not read
        self._send(code, sentence.encode(), TEXT)

    def _send(self, code: int, content: bytes, kind: str) -> None:
        """Answer with an HTTP status `code` and content of this kind."""
        self.send_response(code)
        for name, text in {**HEADERS, "Content-Type": kind, "Content-Length": len(content)}.items():
            self.send_header(name, str(text))
        if self.close_connection:
            self.send_header("Connection", "close")
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
        Thread(target=server.serve_forever, args=(GLANCE,), daemon=True).start()
        try:
            started(f"http://{HOST}:{server.server_port}{server.base}")
            _answer_questions(server, answer)
        finally:
            server.shutdown()  # or its thread would spin on a socket that is closed


def _answer_questions(server: _Server, answer: Answer) -> None:
    """Answer what is asked, one question after the other, until Ctrl-C raises KeyboardInterrupt."""
    while True:
        try:
            name, asked, waiting = server.jobs.get(timeout=GLANCE)
        except Empty:  # a signal that comes as the wait begins would else wait for a question
            continue
        waiting.put(_encode_answer(answer(name, asked)))


def _parse_question(question: bytes) -> Any:
    """What a question says; None where it is no JSON, or nested too deeply to be read."""
    try:
        return json.loads(question)
    except (ValueError, RecursionError):
        return None


def _encode_answer(answer: Mapping[str, Any]) -> _Told:
    """An answer as JSON; a sentence where it has a number that JSON has not, or no such value."""
    try:
        text = json.dumps(answer, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        return 500, f"the answer cannot be written as JSON: {in_a_line(error)}".encode(), TEXT
    return 200, text.encode(), "application/json"
