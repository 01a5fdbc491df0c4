"""Retries of requests to a server: exponential back-off with full jitter, by tenacity."""

from collections.abc import Callable
from typing import Any

from tenacity import AsyncRetrying, RetryCallState, retry_if_result, stop_after_attempt, wait_random_exponential

from rearl_jax.config.llm import LlmConfig


def retrying(config: LlmConfig, is_transient: Callable[[Any], bool], **changes: Any) -> AsyncRetrying:
    """Retries of one request: a callable that takes the sending function and returns the last result.

    The pause after the n-th try is uniform in [0, llm.backoff 2^(n - 1)] s, so that requests that failed at the same
    time are not repeated at the same time. `changes` replace arguments of `AsyncRetrying`.
    """
    usual = {
        "retry": retry_if_result(is_transient),
        "wait": wait_random_exponential(multiplier=config.backoff),
        "stop": stop_after_attempt(config.tries),
        "retry_error_callback": last_result,
    }
    return AsyncRetrying(**(usual | changes))


def last_result(state: RetryCallState) -> Any:
    """The result of the last try."""
    assert state.outcome is not None
    return state.outcome.result()
