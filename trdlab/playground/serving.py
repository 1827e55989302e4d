"""Serves the playground to a browser on this computer."""

import sys
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from trdlab.errors import InputError
from trdlab.playground import page


def server_at(port: int) -> ThreadingHTTPServer:
    """Returns a server of the playground that only this computer can reach.

    Args:
        port: where it listens; 0 is any free port.

    Raises:
        InputError: the port is taken, or may not be used.
    """
    try:
        return _Server(("127.0.0.1", port), _Handler)
    except OSError as error:
        raise InputError(
            f"Port {port} cannot be used: {error.strerror or error}.",
            "Choose another one, or `port=0` for any that is free.",
        ) from error


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    allow_reuse_address = sys.platform != "win32"  # where it would share a port that is taken


class _Handler(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        if self.path.partition("?")[0] != "/":
            self.send_error(HTTPStatus.NOT_FOUND, "The playground is at /")
            return
        content = page().encode()
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: Any) -> None:
        """Keeps quiet."""
