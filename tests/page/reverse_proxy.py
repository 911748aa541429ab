"""A small reverse proxy that serves the page below a prefix, WebSockets included."""

from __future__ import annotations

import asyncio
import mimetypes
import threading


class ReverseProxy:
    """Passes `PREFIX/...` on to a port of loopback, the prefix cut off; use as a context manager.

    With a `folder` in place of the port it serves the files there. `outside`: what else was asked
    for.
    """

    def __init__(self, prefix, port, folder=None):
        self._prefix, self._port, self._folder = prefix, port, folder
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self.outside = []

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}{self._prefix}/"

    def __enter__(self):
        self._thread.start()
        self._server = self._do(asyncio.start_server(self._serve, "127.0.0.1", 0))
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    def __exit__(self, *_):
        self._loop.call_soon_threadsafe(self._server.close)
        self._do(self._end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10)
        self._loop.close()

    def _do(self, work):
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(20)

    async def _end(self):
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    async def _serve(self, reader, writer):
        try:
            head = (await reader.readuntil(b"\r\n\r\n")).decode("latin1")
            first, *lines = head.split("\r\n")
            method, path, _ = first.split(" ")
            if not path.startswith(f"{self._prefix}/"):
                self.outside.append(path)
                writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
            elif self._folder is not None:
                self._send_file(path, writer)
            else:
                await self._pass(method, path.removeprefix(self._prefix), lines, reader, writer)
            await writer.drain()
        except (OSError, asyncio.IncompleteReadError):
            pass
        finally:
            writer.close()

    def _send_file(self, path, writer):
        name = path.partition("?")[0].lstrip("/") or "index.html"
        file = self._folder / name
        if not file.is_file():
            writer.write(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
            return
        kind, content = mimetypes.guess_type(name)[0], file.read_bytes()
        head = f"Content-Type: {kind}\r\nContent-Length: {len(content)}\r\nConnection: close"
        writer.write(f"HTTP/1.1 200 OK\r\n{head}\r\n\r\n".encode() + content)

    async def _pass(self, method, path, lines, reader, writer):
        behind, to_behind = await asyncio.open_connection("127.0.0.1", self._port)
        upgrade = any(line.lower().startswith("upgrade:") for line in lines)
        kept = [line for line in lines if not line.lower().startswith("connection:")]
        connection = "Connection: Upgrade" if upgrade else "Connection: close"
        head = "\r\n".join([f"{method} {path} HTTP/1.1", connection, *kept])
        to_behind.write(head.encode("latin1"))
        try:
            await asyncio.wait(
                [
                    asyncio.ensure_future(_pour(reader, to_behind)),
                    asyncio.ensure_future(_pour(behind, writer)),
                ],
                return_when=asyncio.FIRST_COMPLETED,
            )
        finally:
            to_behind.close()


async def _pour(reader, writer):
    while data := await reader.read(65536):
        writer.write(data)
        await writer.drain()
