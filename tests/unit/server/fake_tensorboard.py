"""Stands in for TensorBoard: responds with the request, and ends with its standard input.

With an argument it starts badly: `silent`, `broken` (ends at once) or `failing` (status 500).
"""

import json
import os
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

HOW = sys.argv[1] if len(sys.argv) > 1 else ""


class Handler(BaseHTTPRequestHandler):
    def do_GET(self):
        path = self.path.partition("?")[0].removeprefix("/tensorboard")
        if path == "/gone":
            os._exit(3)
        request = {"target": self.path, "headers": {k.lower(): v for k, v in self.headers.items()}}
        body = json.dumps(request).encode()
        length = {"/short": len(body) + 10, "/huge": 10**9}.get(path, len(body))
        self.send_response(500 if HOW == "failing" else 404 if path == "/missing" else 200)
        self.send_header("Content-Type", "text/html" if path == "/" else "application/json")
        if path != "/endless":
            self.send_header("Content-Length", str(length))
        self.send_header("Set-Cookie", "volery=1")
        self.send_header("Keep-Alive", "timeout=5")
        self.send_header("Content-Security-Policy", "default-src *")
        self.send_header("Access-Control-Allow-Origin", "*")
        self.send_header("Location", "https://elsewhere.example")
        self.end_headers()
        self.wfile.write(body)
        while path == "/endless":
            self.wfile.write(bytes(1 << 16))

    def log_message(self, *_):
        pass


def main():
    if HOW == "broken":
        sys.stdout.write("no event files\nat all\n")
        sys.exit(1)
    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.handle_error = lambda *_: None
    if HOW != "silent":
        sys.stdout.write(f"Listens at http://127.0.0.1:{server.server_port}/tensorboard/\n")
        sys.stdout.flush()
    threading.Thread(target=server.serve_forever, daemon=True).start()
    while os.read(0, 1):
        pass


main()
