"""Asynchronous storage of answers: a separate thread reads and writes the file, many answers at a time."""

import asyncio
import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from rearl_jax.config.llm import Profile
from rearl_jax.llm.answers import Answers
from rearl_jax.llm.records import Reply

log = logging.getLogger(__name__)


class Keeper:
    """The stored answers of one model, for one event loop."""

    def __init__(self, answers: Answers, model: str, profile: Profile) -> None:
        """Takes over the open file, which no other object may use until `close` has been called."""
        self._answers = answers
        self._model = model
        self._profile = profile
        self._thread = ThreadPoolExecutor(1, "rearl-answers")
        self._waiting: dict[str, tuple[Reply, asyncio.Future[Reply]]] = {}
        self._writer: asyncio.Task[None] | None = None
        self._is_failing = False

    async def find(self, digests: Sequence[str]) -> dict[str, Reply]:
        """Stored answers to the given requests, by digest; a request without a stored answer is left out.

        Raises:
            InvalidInputError: The file is damaged.
        """
        return await asyncio.get_running_loop().run_in_executor(self._thread, self._answers.find, digests)

    def keep(self, digest: str, reply: Reply, done: asyncio.Future[Reply]) -> None:
        """Stores a reply with a text; `done` gets the stored one, this reply or an earlier one of another process."""
        self._waiting[digest] = reply, done
        if self._writer is None or self._writer.done():
            self._writer = asyncio.create_task(self._write())

    async def close(self) -> None:
        """Waits until everything is written; the file stays open."""
        if self._writer is not None:
            await self._writer
        self._thread.shutdown()

    async def _write(self) -> None:
        loop = asyncio.get_running_loop()
        while self._waiting:
            batch, self._waiting = self._waiting, {}
            replies = {digest: reply for digest, (reply, _) in batch.items()}
            try:
                kept = await loop.run_in_executor(self._thread, self._answers.keep, replies, self._model, self._profile)
            except OSError as error:
                kept = replies
                if not self._is_failing:
                    self._is_failing = True
                    log.error(
                        "answers cannot be stored any more (%s): they are used, but the next run requests them again",
                        error,
                    )
            except Exception as error:  # passed to the caller, who would otherwise wait forever
                for _, done in batch.values():
                    if not done.done():
                        done.set_exception(error)
                continue
            for digest, (_, done) in batch.items():
                if not done.done():
                    done.set_result(kept[digest])
