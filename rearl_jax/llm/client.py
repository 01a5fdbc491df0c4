"""Client that obtains answers from a language model behind an OpenAI-compatible server.

The client sends each distinct chat once and stores every answer. Every question gets an answer or the cause of its
absence, whatever the server does. The event loop runs in a separate thread, so a simulation can continue while its
questions are pending.
"""

import asyncio
import logging
import threading
from collections import Counter
from collections.abc import Callable, Coroutine, Mapping, Sequence
from concurrent.futures import Future
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from rearl_jax.config.llm import LlmConfig
from rearl_jax.llm.answers import Answers, answers_path
from rearl_jax.llm.connection import Connection, read_key, server_address
from rearl_jax.llm.keeping import Keeper
from rearl_jax.llm.parameters import without
from rearl_jax.llm.parsing import majority, understand
from rearl_jax.llm.profiles import request_body, request_digest
from rearl_jax.llm.prompt_length import PromptLengths
from rearl_jax.llm.records import NO_DECISION, Answer, Cause, Question, Reply
from rearl_jax.llm.requests_table import Counts, request_row, requests_frame
from rearl_jax.llm.sending import Job, Sender
from rearl_jax.llm.startup import Server, examine_server, replayed
from rearl_jax.llm.usability import check_usable

if TYPE_CHECKING:
    import pandas

log = logging.getLogger(__name__)

_Result = TypeVar("_Result")

Read: TypeAlias = Callable[[str, tuple[int, ...], str], tuple[int, Cause]]
"""Function that parses an answer: its text, the admissible choices and the finish reason give an action and a cause."""


_Asked: TypeAlias = tuple[Question, tuple[str, ...]]
"""A question and the digests of its requests, one per vote."""


class Client:
    """Client of a language model; a context manager.

    `with Client(config, "http://127.0.0.1:8000/v1") as client: client.submit(questions).result()`
    """

    def __init__(self, config: LlmConfig, base_url: str, *, replay: bool = False, read: Read = understand) -> None:
        """Prepares the client; nothing is opened yet.

        Args:
            config: Model, sampling, time-outs, and file of the answers.
            base_url: Address of the server, with or without `/v1` at its end; not used for a replay.
            replay: Whether only stored answers are given, without a server.
            read: Function that parses an answer; its action is NO_DECISION if the answer contains none.

        Raises:
            InvalidInputError: The address is invalid, or a key of the configuration is out of range.
        """
        config.check()
        self._config = config
        self._replay = replay
        self._read = read
        self._address = "" if replay else server_address(base_url)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        self._connection: Connection | None = None
        self._sender: Sender | None = None
        self._answers: Answers | None = None
        self._keeper: Keeper | None = None
        self._server: Server | None = None
        self._jobs: dict[str, Job] = {}
        self._work: set[asyncio.Task[Any]] = set()
        self._rows: list[tuple[Any, ...]] = []
        self._questions = 0
        self._kept = self._unanswered = 0
        self._causes: Counter[Cause] = Counter()
        self._last_texts: dict[Cause, str] = {}
        self._prompts: PromptLengths | None = PromptLengths()

    def __enter__(self) -> "Client":
        return self.open()

    def __exit__(self, *error: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Client({self.address or 'replay'!r}, model={self.server.model if self._server else None!r})"

    def open(self) -> "Client":
        """This client, after the server is ready and the file of answers is open.

        Raises:
            ServerError: There is no server, or it does not become ready.
            InvalidInputError: The server does not have the model or refuses access, or the file of answers cannot be
                used.
            MissingInputError: There are no answers to replay.
        """
        if self._loop is not None:
            raise RuntimeError("the client is open already")
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="rearl-llm", daemon=True)
        self._thread.start()
        try:
            self._in_loop(self._open()).result()
        except BaseException:  # also after an interruption
            self.close()
            raise
        return self

    def close(self) -> None:
        """Stops pending requests and closes all connections and files; received answers are kept."""
        loop, thread = self._loop, self._thread
        if loop is None or thread is None:
            return
        self._in_loop(self._close()).result()
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        loop.close()
        self._loop = self._thread = None

    @property
    def address(self) -> str:
        """Address of the server with its version, as requests are sent to it; empty for a replay."""
        return self._address.partition("?")[0] if self._connection is None else self._connection.address

    @property
    def server(self) -> Server:
        """Model and dialect of the server.

        Raises:
            RuntimeError: The client is not open.
        """
        if self._server is None:
            raise RuntimeError("the client is not open: use it in a with statement, or call open() first")
        return self._server

    def submit(self, questions: Sequence[Question], *, second: int | None = None) -> Future[list[Answer]]:
        """Answers in the order of the questions, within the deadline of the configuration.

        Equal questions are sent once, and in the order of the questions, so that the server can reuse the beginning of
        one question for the next.

        Raises:
            RuntimeError: The client is not open.
            InvalidInputError: From the future: the file of answers is damaged.
        """
        config, server = self._config, self.server
        bodies: dict[str, str] = {}
        asked = []
        for question in questions:
            digests = []
            for vote in range(config.votes):
                body = request_body(
                    question.messages,
                    question.choices,
                    model=server.model,
                    dialect=server.dialect,
                    config=config,
                    seed=config.seed + vote,
                )
                digest = request_digest(body, server.dialect)
                # The digest includes refused parameters, so that a replay finds the answer whichever were refused.
                bodies.setdefault(digest, without(body, server.refused))
                digests.append(digest)
            asked.append((question, tuple(digests)))
        return self._in_loop(self._answer(asked, bodies, second))

    @property
    def counts(self) -> Counts:
        """Progress of the client; cheap, from any thread."""
        causes = dict(self._causes)
        of_sender = {name: getattr(self._sender, name, 0) for name in ("sent", "tries", "waiting", "in_flight")}
        return Counts(self._questions, sum(causes.values()), causes, self._kept, **of_sender)

    def check_usable(self, *, is_finished: bool, any_text: bool = False) -> None:
        """Raise InvalidInputError if too few questions have an answer, or no answer is usable.

        Args:
            is_finished: Whether there are no further questions; before the end, a few questions may lack an answer.
            any_text: Whether any text of the model counts as a result.
        """
        reasons = {cause: f"the last answer was {text[:80]!r}" for cause, text in self._last_texts.items()}
        check_usable(
            self.counts,
            reasons | (self._sender.reasons if self._sender is not None else {}),
            is_finished=is_finished,
            any_text=any_text,
            unanswered_in_a_row=self._unanswered,
            refused_in_a_row=self._sender.refused_in_a_row if self._sender is not None else 0,
            most_refused=self._config.breaker_failures,
        )

    def requests_frame(self) -> "pandas.DataFrame":
        """A row for every reply to every question so far; columns as in `requests_table.COLUMNS`."""
        return requests_frame(self._rows.copy())

    def _in_loop(self, work: Coroutine[Any, Any, _Result]) -> Future[_Result]:
        assert self._loop is not None
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    async def _open(self) -> None:
        config = self._config
        self._enter()
        self._answers = Answers(answers_path(config), read_only=self._replay)
        if self._replay:
            server = replayed(self._answers, config)
        else:
            self._connection = Connection(self._address, config, read_key(config.api_key_env))
            server = await examine_server(self._connection, config)
            self._sender = Sender(self._connection, config, self._finish)
        self._keeper = Keeper(self._answers, server.model, server.dialect.profile)
        self._server = server

    async def _close(self) -> None:
        self._server = None
        for task in self._work:
            task.cancel()
        await asyncio.gather(*self._work, return_exceptions=True)
        if self._sender is not None:
            await self._sender.close()
        if self._connection is not None:
            await self._connection.close()
        if self._keeper is not None:
            await self._keeper.close()
        if self._answers is not None:
            self._answers.close()
        await asyncio.get_running_loop().shutdown_asyncgens()

    async def _answer(self, asked: list[_Asked], bodies: Mapping[str, str], second: int | None) -> list[Answer]:
        """Answers to one burst, the questions of one call of `submit`; `late` for those after the deadline."""
        self._enter()
        self._questions += len(asked)
        loop = asyncio.get_running_loop()
        deadline = loop.time() + self._config.deadline
        new = [Job(digest, body) for digest, body in bodies.items() if digest not in self._jobs]
        # From here on later bursts with the same request wait for this job, even before it is looked up.
        self._jobs |= {job.digest: job for job in new}
        jobs = {digest: self._jobs[digest] for digest in bodies}
        for job in jobs.values():
            job.waiting += 1
            job.deadline = deadline  # bursts come in the order of time, so the last deadline is the latest
        try:
            if new:
                # Not stopped with this burst, because others may already wait for the same requests.
                await asyncio.shield(asyncio.ensure_future(self._look_up(new)))
            waiting = [job.done for job in jobs.values() if not job.done.done()]
            if waiting:
                await asyncio.wait(waiting, timeout=deadline - loop.time())
            replies = {
                digest: job.done.result() if job.done.done() else job.reply(Cause.late) for digest, job in jobs.items()
            }
        finally:
            for job in jobs.values():
                self._leave(job)
        return self._conclude(asked, replies, {job.digest for job in new if job.tries}, second)

    def _enter(self) -> None:
        """Registers the running task, which has to end before the client closes."""
        task = asyncio.current_task()
        assert task is not None
        self._work.add(task)
        task.add_done_callback(self._work.discard)

    async def _look_up(self, jobs: list[Job]) -> None:
        """Reads stored answers from the file and passes the other jobs to the sender."""
        assert self._keeper is not None
        self._enter()
        problem, stored = None, {}
        try:
            stored = await self._keeper.find([job.digest for job in jobs])
        except ValueError as error:
            problem = error
        self._kept += len(stored)
        missing = []
        for job in jobs:
            if job.done.done():  # abandoned in the meantime
                continue
            if problem is not None:
                job.done.set_exception(problem)
            elif job.digest in stored:
                job.done.set_result(stored[job.digest])
            elif self._sender is None:
                job.done.set_result(job.reply(Cause.not_kept))
            else:
                missing.append(job)
        if self._sender is not None:
            self._sender.add(missing)

    def _finish(self, job: Job, reply: Reply) -> None:
        """Sets the result of a job, after an answer is stored."""
        if job.done.done():
            return
        if reply.cause is Cause.answered and self._keeper is not None:
            self._keeper.keep(job.digest, reply, job.done)
        else:
            job.done.set_result(reply)

    def _leave(self, job: Job) -> None:
        """Ends the wait of one burst for a job; the job is stopped if no other burst waits for it."""
        job.waiting -= 1
        if job.waiting:
            return
        del self._jobs[job.digest]
        if job.done.done():
            job.done.exception()  # retrieved, because asyncio logs exceptions that are never retrieved
        elif self._sender is not None:
            self._sender.abandon(job)

    def _conclude(
        self, asked: list[_Asked], replies: Mapping[str, Reply], sent: set[str], second: int | None
    ) -> list[Answer]:
        """The answer to every question from its replies; each reply becomes a row of the table."""
        answers = []
        for question, digests in asked:
            votes = []
            for vote, digest in enumerate(digests):
                reply = replies[digest]
                action, cause = NO_DECISION, reply.cause
                if reply.text is not None:
                    action, cause = self._read(reply.text, question.choices, reply.finish)
                    self._last_texts[cause] = reply.text
                    self._watch_prompt(question, reply)
                votes.append((action, cause))
                of_row = {"digest": digest, "second": second, "vote": vote, "was_sent": digest in sent}
                self._rows.append(request_row(question, reply, **of_row, action=action, cause=cause.name))
                sent.discard(digest)
            action, cause = votes[0] if len(votes) == 1 else majority(votes)
            self._causes[cause] += 1
            self._unanswered = 0 if cause.is_answer else self._unanswered + 1
            answers.append(Answer(action, cause, tuple(replies[digest] for digest in digests), digests[0]))
        return answers

    def _watch_prompt(self, question: Question, reply: Reply) -> None:
        """Warns once if the server truncates prompts."""
        n_characters = sum(len(message.text) for message in question.messages)
        if reply.from_cache or self._prompts is None or not self._prompts.is_cut(n_characters, reply.prompt_tokens):
            return
        self._prompts = None
        log.warning(
            "the server at %s counted %d tokens of a prompt of %d characters: it has cut it; raise its context length",
            self.address,
            reply.prompt_tokens,
            n_characters,
        )
