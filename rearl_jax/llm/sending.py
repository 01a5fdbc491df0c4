"""Sending of requests in their order, a limited number at a time, with retries.

Everything here runs in one event loop. Every job gets a reply, with a cause if there is no answer.
"""

import asyncio
import contextlib
import functools
import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from tenacity import RetryCallState, wait_random_exponential

from rearl_jax.config.llm import LlmConfig
from rearl_jax.llm.breaker import Breaker
from rearl_jax.llm.connection import Connection, Response
from rearl_jax.llm.profiles import read_completion
from rearl_jax.llm.records import TEXTS, Cause, Completion, Reply
from rearl_jax.llm.retries import last_result, retrying

log = logging.getLogger(__name__)

_OF_ONE_REQUEST = (400, 413, 415, 422)
"""HTTP statuses of refusals that may concern a single request; with others the server refuses all requests."""


@dataclass(eq=False, slots=True)
class Job:
    """One pending request.

    Attributes:
        digest: Hash of the request.
        body: Body of the request.
        done: Future of the reply.
        deadline: Time of the event loop after which no burst waits for the job; a burst is the questions of one second.
        waiting: Number of bursts that wait for the job.
        started: Time of the first sending; None before.
        tries: Number of times the request was sent.
        status: Last HTTP status.
        task: Task that sends the request; None before.
    """

    digest: str
    body: str
    done: "asyncio.Future[Reply]" = field(default_factory=lambda: asyncio.get_running_loop().create_future())
    deadline: float = 0.0
    waiting: int = 0
    started: float | None = None
    tries: int = 0
    status: int | None = None
    task: "asyncio.Task[None] | None" = None

    def reply(self, cause: Cause, completion: Completion | None = None) -> Reply:
        """The reply to this job at this time."""
        latency = 0.0 if self.started is None else asyncio.get_running_loop().time() - self.started
        answered = vars(completion) if completion else {}
        return Reply(**answered, cause=cause, latency=latency, tries=self.tries, status=self.status)


@dataclass(frozen=True)
class _Try:
    """Result of one sending: a completion, or a cause and whether a retry can help.

    `is_alive` is also true for a server that is busy or refuses the request.
    """

    cause: Cause
    completion: Completion | None = None
    is_transient: bool = False
    is_alive: bool = False
    why: str = ""
    retry_after: float = 0.0


class Sender:
    """Sends jobs to one server."""

    def __init__(self, connection: Connection, config: LlmConfig, finish: Callable[[Job, Reply], None]) -> None:
        """Prepares the sender; nothing is sent yet. `finish` is called with every reply."""
        self._connection = connection
        self._config = config
        self._finish = finish
        self._breaker = Breaker(config.breaker_failures, config.breaker_pause)
        self._slots = asyncio.Semaphore(config.max_in_flight)
        self._probe = asyncio.Lock()
        self._is_down = asyncio.Event()
        self._waiting: set[Job] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._reported: set[Cause] = set()
        self.in_flight = 0
        self.sent = 0
        self.tries = 0
        self.refused_in_a_row = 0
        self.reasons: dict[Cause, str] = {}

    @property
    def waiting(self) -> int:
        """Jobs that are not sent yet."""
        return len(self._waiting)

    def add(self, jobs: list[Job]) -> None:
        """Queues jobs in this order."""
        self._waiting.update(jobs)
        for job in jobs:
            job.task = asyncio.create_task(self._run(job))
            self._tasks.add(job.task)
            job.task.add_done_callback(functools.partial(self._ended, job))

    def abandon(self, job: Job) -> None:
        """Stops a job that no burst waits for any more; it gets no reply."""
        job.done.cancel()
        if job.task is not None:
            job.task.cancel()

    async def close(self) -> None:
        """Stops all jobs."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    def _ended(self, job: Job, task: asyncio.Task[None]) -> None:
        self._waiting.discard(job)
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None and not job.done.done():
            job.done.set_exception(error)  # a programming error, which the caller must see

    async def _run(self, job: Job) -> None:
        async with self._slots:
            last = await self._send_unless_down(job)
        self._finish(job, job.reply(last.cause, last.completion))

    async def _send_unless_down(self, job: Job) -> _Try:
        """Result of a job; while the server counts as down, one job is sent as a probe and the others wait for it."""
        if self._breaker.is_open:
            async with self._probe:
                if self._breaker.refuses:
                    return _Try(Cause.broken)
                if self._breaker.is_open:
                    return await self._send(job, is_probe=True)
        return await self._send(job, is_probe=False)

    async def _send(self, job: Job, *, is_probe: bool) -> _Try:
        self._waiting.discard(job)
        self.in_flight += 1
        self.sent += 1
        try:
            last = await self._ask(job)
        finally:
            self.in_flight -= 1
        self._tell_breaker(last, is_probe)
        if last.completion is None:
            self._report(job, last)
        return last

    async def _ask(self, job: Job) -> _Try:
        """Result of the last of at most `llm.tries` tries; no retries while the server counts as down."""
        loop = asyncio.get_running_loop()
        job.started = loop.time()
        body = job.body.encode()
        last: _Try | None = None

        async def send() -> _Try:
            nonlocal last
            if last is not None and self._is_down.is_set():
                return replace(last, is_transient=False)
            job.tries += 1
            self.tries += 1
            response = await self._connection.post("/chat/completions", body)
            job.status = response.status or job.status
            last = self._result_of(response)
            if last.completion is not None:
                self.refused_in_a_row = 0
            elif response.is_refusal and response.status not in _OF_ONE_REQUEST:
                self.refused_in_a_row += 1
            return last

        jitter = wait_random_exponential(multiplier=self._config.backoff)

        def pause(state: RetryCallState) -> float:
            return jitter(state) + last_result(state).retry_after

        def is_last(state: RetryCallState) -> bool:
            return state.attempt_number >= self._config.tries or loop.time() + state.upcoming_sleep >= job.deadline

        tried = retrying(
            self._config,
            lambda tried: tried.is_transient,
            wait=pause,
            stop=is_last,
            sleep=self._sleep,
            retry_error_callback=self._give_up,
        )
        return await tried(send)

    def _give_up(self, state: RetryCallState) -> _Try:
        """Result of a job that is not sent again, after too many tries or without time left."""
        last = last_result(state)
        if state.attempt_number >= self._config.tries:
            return last
        return replace(last, cause=Cause.late, why=f"{last.why}; no time for another try")

    def _result_of(self, response: Response) -> _Try:
        if response.status is None:
            cause = Cause.late if response.timed_out else Cause.failed
            return _Try(cause, is_transient=True, why=response.error)
        if response.status == 200:
            try:
                completion = read_completion(response.content)
            except ValueError as error:
                return _Try(Cause.failed, is_transient=True, why=str(error))
            return _Try(Cause.answered, self._without_key(completion), is_alive=True)
        return _Try(
            Cause.refused if response.is_refusal else Cause.failed,
            is_transient=not response.is_refusal,
            is_alive=response.is_refusal or response.status == 429,
            why=response.reason,
            retry_after=response.retry_after or 0.0,
        )

    def _without_key(self, completion: Completion) -> Completion:
        hide = self._connection.without_key
        return replace(completion, **{name: hide(getattr(completion, name)) for name in TEXTS})

    def _tell_breaker(self, last: _Try, is_probe: bool) -> None:
        """Reports the result of a request to the breaker."""
        if last.is_alive:
            if self._breaker.succeeded():
                self._is_down.clear()
                log.warning("the server at %s answers again", self._connection.place)
        elif self._breaker.failed(is_probe) and not is_probe:
            self._is_down.set()
            log.warning(
                "%d requests in a row failed: the server at %s counts as down, and questions remain unanswered; it is "
                "tried again every %g s",
                self._config.breaker_failures,
                self._connection.place,
                self._config.breaker_pause,
            )

    async def _sleep(self, pause: float) -> None:
        """Waits until a pause [s] is over or the server counts as down."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(pause):
                await self._is_down.wait()

    def _report(self, job: Job, result: _Try) -> None:
        """Logs each kind of failure when it occurs for the first time."""
        self.reasons[result.cause] = self._connection.without_key(result.why)
        if not result.is_alive:  # questions that are not sent from now on have the same reason
            self.reasons[Cause.broken] = self.reasons[result.cause]
        if result.cause not in self._reported:
            self._reported.add(result.cause)
            log.warning(
                "a request to %s remained without an answer (%s after %d tries; the first of its kind, others are "
                "counted): %s",
                self._connection.place,
                result.cause.name,
                job.tries,
                self.reasons[result.cause],
            )
