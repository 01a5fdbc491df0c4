"""A server of chat completions on the loopback interface, which produces faults on demand.

Its answers are a function of the chat alone, so runs can be compared. It records every request.
"""

import asyncio
import hashlib
import json
import re
import socket
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from email.utils import formatdate
from enum import Enum, auto


class Fault(Enum):
    """Faults of a response."""

    too_many = auto()
    """Status 429."""
    too_many_wait = auto()
    """Status 429 with Retry-After in seconds."""
    too_many_date = auto()
    """Status 429 with Retry-After as a date."""
    internal_error = auto()
    unavailable = auto()
    garbage = auto()
    """Bytes that are not HTTP."""
    half_body = auto()
    """Fewer bytes than announced, then the end of the connection."""
    closed = auto()
    """The end of the connection without a byte."""
    reset = auto()
    """The connection is reset."""
    late = auto()
    """A valid answer after `Stub.stall`."""
    never = auto()
    empty = auto()
    """Status 200 without a body."""
    broken_json = auto()
    wrong_json = auto()
    """JSON of another shape."""
    deep_json = auto()
    """JSON nested more deeply than Python reads."""
    html = auto()
    no_choices = auto()
    null_content = auto()
    enormous = auto()
    """A text of 6 MiB."""
    endless = auto()
    """A body without an end."""


STATUS = dict.fromkeys((Fault.too_many, Fault.too_many_wait, Fault.too_many_date), 429)
STATUS |= {Fault.internal_error: 500, Fault.unavailable: 503}
"""HTTP status of the faults that have one."""


@dataclass(frozen=True)
class Request:
    """One received request; `number` counts the requests with the same body so far, `time` is when it came [s]."""

    method: str
    path: str
    headers: dict[str, str]
    body: dict
    raw: bytes
    number: int
    time: float

    @property
    def is_trial(self) -> bool:
        return "capital of France" in self.raw.decode()


def chat_digest(body: dict) -> int:
    """A number that depends on the chat and the seed."""
    text = json.dumps([body["messages"], body.get("seed")], sort_keys=True)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")


def allowed(body: dict) -> list[str] | None:
    """The texts a constraint in any dialect allows; None without one."""
    if "structured_outputs" in body:
        return body["structured_outputs"]["choice"]
    if "response_format" in body:
        return [str(value) for value in body["response_format"]["json_schema"]["schema"]["enum"]]
    constraint = body.get("regex", body.get("grammar"))
    return re.findall(r"\d", constraint) if constraint else None


def right_answer(body: dict, constrains: bool = True) -> str:
    """The answer to a chat: one of the allowed texts, or an action."""
    texts = (allowed(body) if constrains else None) or ["0", "1", "2", "3", "4"]
    return texts[chat_digest(body) % len(texts)]


class Stub:
    """The server, in a thread of its own; a context manager. It can be stopped and started again on the same port."""

    def __init__(
        self,
        *,
        latency: float = 0.0,
        slots: int = 1_000_000,
        stall: float = 1.0,
        retry_after: int = 0,
        models: tuple[str, ...] = ("stub-model",),
        owned_by: str = "vllm",
        header: str = "stub",
        constrains: bool = True,
        key: str = "",
        fault: Callable[[Request], Fault | int | None] = lambda request: None,
        trial_fault: Callable[[Request], Fault | int | None] = lambda request: None,
        refuse: Callable[[dict], dict | None] = lambda body: None,
        lists: bool = True,
        root: str = "/v1",
        say: Callable[[dict], dict] | None = None,
    ) -> None:
        """Nothing runs yet.

        Times are in s; `slots` is the largest number of chats answered at a time. `fault` gives the fault or HTTP
        status of a chat request, `trial_fault` that of a trial request, `refuse` the error that a body gets with status
        400, `say` the whole response to a body. `lists`: whether the server lists its models; `root`: path of
        everything.
        """
        self.latency, self.stall, self.retry_after = latency, stall, retry_after
        self.models, self.owned_by, self.header = models, owned_by, header
        self.constrains, self.key, self.fault, self.say = constrains, key, fault, say
        self.trial_fault, self.refuse, self.lists, self.root = trial_fault, refuse, lists, root
        self.loading = 0
        self.log: list[Request] = []
        self.busiest = 0
        self._slots = slots
        self._busy = 0
        self._numbers: Counter[bytes] = Counter()
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._connections: set[asyncio.StreamWriter] = set()
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}{self.root}"

    @property
    def chats(self) -> list[Request]:
        """The received chats, without trial requests."""
        return [request for request in self.log if request.method == "POST" and not request.is_trial]

    def __enter__(self) -> "Stub":
        self.start()
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def start(self, port: int | None = None) -> None:
        ready = threading.Event()
        self.port = port or self.port
        self._loop = loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=lambda: loop.run_until_complete(self._serve(ready)), daemon=True)
        self._thread.start()
        if not ready.wait(10.0):
            raise RuntimeError("the stub does not start")

    def stop(self) -> None:
        """Ends at once; the connections of pending requests are reset."""
        if self._thread is None or self._loop is None:
            return
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()
        self._loop.close()
        self._thread = None

    async def _serve(self, ready: threading.Event) -> None:
        self._end = asyncio.Event()
        self._free = asyncio.Semaphore(self._slots)
        server = await asyncio.start_server(self._talk, "127.0.0.1", self.port, backlog=1024, limit=2**22)
        ready.set()
        await self._end.wait()
        server.close()
        for writer in list(self._connections):
            _reset(writer)
        tasks = asyncio.all_tasks() - {asyncio.current_task()}
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._connections.add(writer)
        try:
            while not writer.is_closing():
                request = await self._read(reader)
                self.log.append(request)
                await self._respond(request, writer)
        except (asyncio.IncompleteReadError, ConnectionError, asyncio.CancelledError):
            pass
        finally:
            self._connections.discard(writer)
            writer.close()

    async def _read(self, reader: asyncio.StreamReader) -> Request:
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
        method, path, _ = head[0].split(" ")
        headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in head[1:] if line)}
        raw = await reader.readexactly(int(headers.get("content-length", 0)))
        self._numbers[raw] += 1
        body = json.loads(raw) if raw else {}
        return Request(method, path, headers, body, raw, self._numbers[raw], time.monotonic())

    async def _respond(self, request: Request, writer: asyncio.StreamWriter) -> None:
        if self.key and request.headers.get("authorization") != f"Bearer {self.key}":
            self._write(writer, 401, {"error": {"message": f"wrong key {request.headers.get('authorization')}"}})
        elif self.loading > 0:
            self.loading -= 1
            self._write(writer, 503, {"error": {"message": "Loading model"}})
        elif request.path == f"{self.root}/models" and self.lists:
            listed = [{"id": model, "object": "model", "owned_by": self.owned_by} for model in self.models]
            self._write(writer, 200, {"object": "list", "data": listed})
        elif request.path == "/api/version" and self.owned_by == "library":
            self._write(writer, 200, {"version": "0.13.0"})
        elif request.path.partition("?")[0] != f"{self.root}/chat/completions":
            self._write(writer, 404, {"error": {"message": "not found"}})
        else:
            async with self._free:
                self._busy += 1
                self.busiest = max(self.busiest, self._busy)
                try:
                    await asyncio.sleep(self.latency)
                    await self._complete(request, writer)
                finally:
                    self._busy -= 1
        await writer.drain()

    async def _complete(self, request: Request, writer: asyncio.StreamWriter) -> None:
        fault = (self.trial_fault if request.is_trial else self.fault)(request)
        if (error := self.refuse(request.body)) is not None:
            self._write(writer, 400, error)
        elif fault is None:
            self._write(writer, 200, self._completion(request.body))
        elif isinstance(fault, int):
            self._write(writer, fault, {"error": {"message": f"status {fault} was asked for"}})
        elif fault in STATUS:
            date = formatdate(time.time() + self.retry_after, usegmt=True)
            waits = {Fault.too_many_wait: str(self.retry_after), Fault.too_many_date: date}
            headers = {"retry-after": waits[fault]} if fault in waits else {}
            self._write(writer, STATUS[fault], {"error": {"message": "not now"}}, headers)
        elif fault is Fault.late or fault is Fault.never:
            await asyncio.sleep(self.stall if fault is Fault.late else 3600.0)
            self._write(writer, 200, self._completion(request.body))
        elif fault is Fault.reset:
            _reset(writer)
        elif fault is Fault.endless:
            writer.write(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n")
            while not writer.is_closing():
                writer.write(b"10000\r\n" + b"x" * 2**16 + b"\r\n")
                await writer.drain()
        else:
            writer.write(self._broken(fault, request.body))
            if fault in (Fault.garbage, Fault.half_body, Fault.closed):
                writer.close()

    def _broken(self, fault: Fault, body: dict) -> bytes:
        """The bytes of a broken response."""
        whole = json.dumps(self._completion(body)).encode()
        contents = {
            Fault.empty: b"",
            Fault.broken_json: whole[:-7],
            Fault.wrong_json: b'{"choices": {"0": "1"}, "usage": []}',
            Fault.deep_json: b"[" * 100_000,
            Fault.html: b"<html><body><h1>It works!</h1></body></html>",
            Fault.no_choices: b'{"choices": []}',
            Fault.null_content: b'{"choices": [{"finish_reason": "stop", "message": {"content": null}}]}',
            Fault.enormous: json.dumps({"choices": [{"message": {"content": "1 " * (3 * 2**20)}}]}).encode(),
        }
        if fault is Fault.garbage:
            return b"\x16\x03\x01\xff" * 100
        if fault is Fault.half_body:
            return _response(200, whole)[: -len(whole) // 2]
        if fault is Fault.closed:
            return b""
        return _response(200, contents[fault], {"content-type": "text/html" if fault is Fault.html else "x/json"})

    def _completion(self, body: dict) -> dict:
        if self.say is not None:
            return self.say(body)
        message = {"role": "assistant", "content": right_answer(body, self.constrains)}
        usage = {"prompt_tokens": 700, "completion_tokens": 2, "prompt_tokens_details": {"cached_tokens": 500}}
        return {"choices": [{"index": 0, "finish_reason": "stop", "message": message}], "usage": usage}

    def _write(self, writer: asyncio.StreamWriter, status: int, content: dict, headers: dict | None = None) -> None:
        writer.write(_response(status, json.dumps(content).encode(), {"server": self.header} | (headers or {})))


def _response(status: int, content: bytes, headers: dict[str, str] | None = None) -> bytes:
    lines = [f"HTTP/1.1 {status} X", f"content-length: {len(content)}"]
    lines += [f"{name}: {value}" for name, value in (headers or {}).items()]
    return "\r\n".join([*lines, "", ""]).encode() + content


def _reset(writer: asyncio.StreamWriter) -> None:
    """Ends a connection with a reset, as a killed process does."""
    connected = writer.get_extra_info("socket")
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()
