"""Serve a folder as an S3 bucket for reading, with a latency: a real server's part in little processor time.

The server of the tests (moto) takes milliseconds of Python for each request; this one sends ranges of files by
``sendfile``. Run as a module it serves until its standard input closes; its first line of output is its URL, its last
one the processor time [s] that it took.

usage: python -m tests.bench.range_server FOLDER LATENCY
"""

from __future__ import annotations

import os
import re
import socket
import sys
import threading
import time
from email.utils import formatdate
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit
from xml.sax.saxutils import escape

BUCKET = "bucket"


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, folder: Path, latency: float) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.folder = folder
        self.latency = latency


class _Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD of objects, and GET of the bucket as ListObjectsV2."""

    protocol_version = "HTTP/1.1"
    server: _Server

    def do_GET(self) -> None:
        time.sleep(self.server.latency)
        parts = urlsplit(self.path)
        _, _, key = unquote(parts.path).lstrip("/").partition("/")
        if not key:
            self._list({name: values[0] for name, values in parse_qs(parts.query).items()})
            return
        path = self.server.folder / key
        if not path.is_file():
            self._answer(404, b"<Error><Code>NoSuchKey</Code></Error>")
            return
        self._send(path)

    do_HEAD = do_GET

    def log_message(self, *_: object) -> None:
        """Log nothing."""

    def _send(self, path: Path) -> None:
        status = path.stat()
        wanted = re.fullmatch(r"bytes=(\d*)-(\d*)", self.headers.get("Range", ""))
        first, end = 0, status.st_size
        if wanted and wanted[1]:
            first, end = int(wanted[1]), min(int(wanted[2]) + 1 if wanted[2] else end, end)
        elif wanted:
            first = max(end - int(wanted[2]), 0)
        self.send_response_only(206 if wanted else 200)
        self.send_header("Content-Length", str(end - first))
        self.send_header("ETag", f'"{status.st_mtime_ns:x}-{status.st_size:x}"')
        self.send_header("Last-Modified", formatdate(status.st_mtime, usegmt=True))
        if wanted:
            self.send_header("Content-Range", f"bytes {first}-{end - 1}/{status.st_size}")
        self.end_headers()
        if self.command == "GET":
            with path.open("rb") as file:
                self.connection.sendfile(file, first, end - first)

    def _list(self, query: dict[str, str]) -> None:
        """Objects below a prefix, or only directly in it, in one page."""
        prefix, folder = query.get("prefix", ""), self.server.folder
        keys = sorted(
            name
            for path in folder.rglob("*")
            if path.is_file() and (name := path.relative_to(folder).as_posix()).startswith(prefix)
        )
        if query.get("delimiter"):
            folders = sorted({name[: name.index("/", len(prefix)) + 1] for name in keys if "/" in name[len(prefix) :]})
            keys = [name for name in keys if "/" not in name[len(prefix) :]]
        else:
            folders = []
        contents = "".join(
            f"<Contents><Key>{escape(name)}</Key><LastModified>2026-01-01T00:00:00.000Z</LastModified>"
            f"<Size>{(folder / name).stat().st_size}</Size></Contents>"
            for name in keys
            if name > query.get("start-after", "")
        )
        common = "".join(f"<CommonPrefixes><Prefix>{escape(name)}</Prefix></CommonPrefixes>" for name in folders)
        body = f"<ListBucketResult><IsTruncated>false</IsTruncated>{contents}{common}</ListBucketResult>"
        self._answer(200, body.encode())

    def _answer(self, status: int, body: bytes) -> None:
        self.send_response_only(status)
        self.send_header("Content-Type", "application/xml")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command == "GET":
            self.wfile.write(body)


def main(folder: str, latency: str) -> None:
    """Serve until standard input closes."""
    server = _Server(Path(folder), float(latency))
    server.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    sys.stdout.write(f"http://127.0.0.1:{server.server_port}\n")
    sys.stdout.flush()
    sys.stdin.read()
    sys.stdout.write(f"{sum(os.times()[:2])}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
