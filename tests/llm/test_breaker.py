"""The circuit breaker, which stops requests to a server that is down."""

from rearl_jax.llm.breaker import Breaker


def test_breaker_opens_after_failures_and_closes_after_an_answer():
    now = [0.0]
    breaker = Breaker(3, 10.0, clock=lambda: now[0])
    assert [breaker.failed(False), breaker.failed(False)] == [False, False]
    assert not breaker.succeeded()
    assert [breaker.failed(False) for _ in range(3)] == [False, False, True]
    assert breaker.refuses
    assert not breaker.failed(False)  # a request sent before the breaker opened
    now[0] = 9.9
    assert breaker.refuses
    now[0] = 10.0
    assert breaker.is_open
    assert not breaker.refuses
    assert breaker.failed(True)
    assert breaker.refuses
    now[0] = 20.0
    assert not breaker.refuses
    assert breaker.succeeded()
    assert not breaker.is_open
    assert not breaker.failed(False)
