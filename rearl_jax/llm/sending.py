"""Requests that wait -> replies: in their order, no more at a time than allowed, tried again where that can help.

Everything here runs in one event loop. A reply with a cause comes out whatever the server does.
"""

import asyncio
import logging
import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from rearl_jax.config.llm import LlmConfig
from rearl_jax.llm.breaker import Breaker
from rearl_jax.llm.connection import Connection, Response
from rearl_jax.llm.profiles import Completion, read_completion, read_error
from rearl_jax.llm.records import Cause, Reply

log = logging.getLogger(__name__)


class Job:
    """One request on its way.

    Attributes:
        digest: Hash of what is sent.
        body: What is sent.
        done: The reply, when there is one.
        deadline: Time of the event loop after which nobody waits for it.
        waiting: How many bursts of questions wait for it.
        started: When it was first sent; None before.
        tries: Times it was sent.
        status: Last HTTP status.
        task: What sends it; None before.
    """

    __slots__ = ("body", "deadline", "digest", "done", "started", "status", "task", "tries", "waiting")

    def __init__(self, digest: str, body: str) -> None:
        self.digest = digest
        self.body = body
        self.done: asyncio.Future[Reply] = asyncio.get_running_loop().create_future()
        self.deadline = 0.0
        self.waiting = 0
        self.started: float | None = None
        self.tries = 0
        self.status: int | None = None
        self.task: asyncio.Task[None] | None = None

    def reply(self, cause: Cause, completion: Completion | None = None) -> Reply:
        """The reply this job has come to now."""
        now = asyncio.get_running_loop().time()
        return Reply(
            text=completion.text if completion else None,
            cause=cause,
            thinking=completion.thinking if completion else "",
            finish=completion.finish if completion else "",
            latency=0.0 if self.started is None else now - self.started,
            tries=self.tries,
            prompt_tokens=completion.prompt_tokens if completion else None,
            cached_tokens=completion.cached_tokens if completion else None,
            answer_tokens=completion.answer_tokens if completion else None,
            status=self.status,
        )


@dataclass(frozen=True)
class _Try:
    """What one sending came to: a completion, or a cause, and whether sending it again can help.

    A server that is busy, or refuses, is not down: `is_alive`.
    """

    cause: Cause
    completion: Completion | None = None
    again: bool = False
    is_alive: bool = False
    why: str = ""


class Sender:
    """Sends jobs to one server."""

    def __init__(self, connection: Connection, config: LlmConfig, finish: Callable[[Job, Reply], None]) -> None:
        """Nothing is sent yet.

        Args:
            connection: To the server.
            config: How many at a time, how often, how long.
            finish: Takes every reply.
        """
        self._connection = connection
        self._config = config
        self._finish = finish
        self._breaker = Breaker(config.breaker_failures, config.breaker_pause)
        self._opened = asyncio.Event()
        self._queue: deque[Job] = deque()
        self._tasks: set[asyncio.Task[None]] = set()
        self._said: set[Cause] = set()
        self.in_flight = 0
        self.sent = 0
        self.tries = 0

    @property
    def waiting(self) -> int:
        """Jobs that are not sent yet."""
        return len(self._queue)

    def add(self, jobs: list[Job]) -> None:
        """Sends jobs in this order, as soon as there is room."""
        self._queue.extend(jobs)
        self._send_next()

    def abandon(self, job: Job) -> None:
        """Stops a job that nobody waits for any more; it gets no reply."""
        job.done.cancel()
        if job.task is not None:
            job.task.cancel()

    async def close(self) -> None:
        """Stops everything."""
        self._queue.clear()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _send_next(self) -> None:
        while self._queue:
            if self._queue[0].done.done():  # abandoned
                self._queue.popleft()
            elif self._breaker.refuses:
                job = self._queue.popleft()
                self._finish(job, job.reply(Cause.broken))
            elif self._breaker.is_probing or self.in_flight >= self._config.max_in_flight:
                return
            else:
                self._start(self._queue.popleft())

    def _start(self, job: Job) -> None:
        self.in_flight += 1
        self.sent += 1
        job.task = asyncio.create_task(self._run(job, is_probe=self._breaker.begin()))
        self._tasks.add(job.task)
        job.task.add_done_callback(lambda task: self._ended(job, task))

    def _ended(self, job: Job, task: asyncio.Task[None]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None and not job.done.done():
            job.done.set_exception(error)  # a mistake of ours: whoever asked must see it

    async def _run(self, job: Job, *, is_probe: bool) -> None:
        try:
            last = await self._ask(job)
        except BaseException:
            self._breaker.given_up(is_probe)
            raise
        else:
            self._learn(last, is_probe)
        finally:
            self.in_flight -= 1
            self._send_next()
        self._finish(job, job.reply(last.cause, last.completion))

    async def _ask(self, job: Job) -> _Try:
        """What the last of at most so many tries came to; while the server counts as down there is no second one."""
        loop = asyncio.get_running_loop()
        job.started = loop.time()
        body = job.body.encode()
        while True:
            job.tries += 1
            self.tries += 1
            response = await self._connection.post("/chat/completions", body)
            job.status = response.status or job.status
            last = self._judge(response)
            if last.completion is not None:
                return last
            if not last.again or job.tries >= self._config.tries:
                break
            # Full jitter, so that those who failed together do not come back together.
            pause = random.uniform(0.0, self._config.backoff * 2.0 ** (job.tries - 1)) + (response.retry_after or 0.0)
            if loop.time() + pause >= job.deadline:
                last = replace(last, cause=Cause.late, why=f"{last.why}; no time for another try")
                break
            if await self._sleep(pause):
                break
        self._report(job, last)
        return last

    def _judge(self, response: Response) -> _Try:
        if response.status is None:
            cause = Cause.late if response.timed_out else Cause.failed
            return _Try(cause, again=True, why=response.error)
        if response.status == 200:
            try:
                completion = read_completion(response.content)
            except ValueError as error:
                return _Try(Cause.failed, again=True, why=str(error))
            return _Try(Cause.answered, self._without_key(completion), is_alive=True)
        why = f"HTTP {response.status}: {read_error(response.content)}"
        is_refused = 300 <= response.status < 500 and response.status not in (408, 429)
        cause = Cause.refused if is_refused else Cause.failed
        return _Try(cause, again=not is_refused, is_alive=is_refused or response.status == 429, why=why)

    def _without_key(self, completion: Completion) -> Completion:
        hide = self._connection.without_key
        return replace(
            completion,
            text=hide(completion.text),
            thinking=hide(completion.thinking),
            finish=hide(completion.finish),
        )

    def _learn(self, last: _Try, is_probe: bool) -> None:
        """Tells the breaker what a request came to."""
        if last.is_alive:
            if self._breaker.succeeded():
                self._opened.clear()
                log.warning("the server at %s answers again", self._connection.address)
        elif self._breaker.failed(is_probe) and not is_probe:
            self._opened.set()
            log.warning(
                "%d requests in a row failed: the server at %s counts as down, and questions remain unanswered; it is "
                "tried again every %g s",
                self._config.breaker_failures,
                self._connection.address,
                self._config.breaker_pause,
            )

    async def _sleep(self, pause: float) -> bool:
        """Whether the breaker opened before the end of a pause [s]."""
        try:
            async with asyncio.timeout(pause):
                await self._opened.wait()
        except TimeoutError:
            return False
        return True

    def _report(self, job: Job, result: _Try) -> None:
        """Says what went wrong when it goes wrong in this way for the first time."""
        if result.cause not in self._said:
            self._said.add(result.cause)
            log.warning(
                "a request to %s remained without an answer (%s after %d tries; the first of its kind, others are "
                "counted): %s",
                self._connection.address,
                result.cause.name,
                job.tries,
                self._connection.without_key(result.why),
            )
