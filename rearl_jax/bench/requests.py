"""`rearl bench requests`: how fast our client asks a language model, beside a plain load generator.

Within a repetition the two ask one after the other, in the reverse order the next time, each its own part of the
questions, so that nobody finds prefixes that the other has left behind; the ratio is taken within a repetition.
"""

from collections.abc import Callable
from dataclasses import replace

from rearl_jax import runtime
from rearl_jax.bench.fresh_client import fresh_client
from rearl_jax.bench.load_generator import send_all
from rearl_jax.bench.measurement import Stopwatch
from rearl_jax.bench.real_questions import make_questions
from rearl_jax.bench.requests_results import Asking, Burst, RequestsResults
from rearl_jax.bench.requests_terminal import print_results
from rearl_jax.config import BenchRequestsTask
from rearl_jax.config.bench import BenchRequestsConfig
from rearl_jax.config.llm import LlmConfig, Profile
from rearl_jax.llm.client import Client
from rearl_jax.llm.local_server import started
from rearl_jax.llm.profiles import request_body
from rearl_jax.llm.records import Cause, Question
from rearl_jax.progress import progress_bar, shown
from rearl_jax.results import Study


def run(config: BenchRequestsTask) -> dict:
    """The summary of the measurements, after writing table, configuration and summary.

    Raises:
        ImportError: requests.server=local, and the server or its model is not installed.
        OSError: A server does not start, or closes connections.
        ValueError: The real server does not have the model or refuses us.
    """
    requests = config.requests
    study = Study(config.results.root, config.study, config, "bench requests")
    study.write_config()
    load = runtime.load_average()
    fixed = real = None
    with progress_bar() as bar:
        command = ["rearl_jax.bench.slow_server", str(requests.latency), str(requests.slots)]
        with started(command, "the measured server") as address:
            step = shown(bar, f"server of {1000 * requests.latency:g} ms")
            plain = replace(config.llm, model="", profile=Profile.plain)
            with fresh_client(plain, address) as client:
                fixed = measure(client, plain, requests, requests.requests, step)
        if requests.server is not None:
            step = shown(bar, f"server {requests.server}")
            with fresh_client(config.llm, requests.server) as client:
                real = measure(client, config.llm, requests, requests.server_requests, step)
    results = RequestsResults(requests, config.llm.max_in_flight, fixed, real, load, runtime.describe_machine())
    study.write_table("bench_requests", results.table(), **results.metadata())
    summary = results.summary()
    study.write_summary(summary)
    print_results(results)
    return summary


def measure(
    client: Client, llm: LlmConfig, requests: BenchRequestsConfig, n: int, progress: Callable[[int, int], None]
) -> Asking:
    """So many questions through the client and as many through the plain load generator, in turn.

    Raises:
        ConnectionError: The server does not answer every request.
    """
    questions = make_questions(2 * n * requests.repetitions, requests.seed)
    parts = [questions[start : start + n] for start in range(0, len(questions), n)]
    ours: list[Burst] = []
    plain: list[Burst] = []
    for number in range(requests.repetitions):
        askers = ((ours, _through_client), (plain, _plainly))
        turn = parts[2 * number : 2 * number + 2]
        for (found, ask), part in zip(askers[:: 1 - 2 * (number % 2)], turn, strict=True):
            found.append(ask(client, llm, part))
            progress(len(ours) + len(plain), 2 * requests.repetitions)
    return Asking(client.address, client.server.model, tuple(ours), tuple(plain))


def _through_client(client: Client, llm: LlmConfig, questions: list[Question]) -> Burst:
    """What our client takes for all answers, kept in its file and listed in its table."""
    watch = Stopwatch()
    with watch:
        answers = client.submit(questions).result()
    missing = sum(answer.replies[0].text is None for answer in answers)
    if missing:
        causes = sorted({answer.cause.name for answer in answers if answer.cause is not Cause.answered})
        raise ConnectionError(
            f"{client.address} left {missing} of {len(questions)} questions open ({', '.join(causes)})"
        )
    replies = [answer.replies[0] for answer in answers]
    prompt, cached = (
        None if any(value is None for value in values) else sum(value for value in values if value is not None)
        for values in ([reply.prompt_tokens for reply in replies], [reply.cached_tokens for reply in replies])
    )
    return Burst(len(questions), watch.wall_s, watch.cpu_s, prompt, cached)


def _plainly(client: Client, llm: LlmConfig, questions: list[Question]) -> Burst:
    """What the plain load generator takes for the same requests; they are written before."""
    server = client.server
    bodies = [
        request_body(
            question.messages,
            question.choices,
            model=server.model,
            dialect=server.dialect,
            config=llm,
            seed=llm.seed,
        )
        for question in questions
    ]
    watch = Stopwatch()
    with watch:
        send_all(client.address, bodies, llm.max_in_flight)
    return Burst(len(questions), watch.wall_s, watch.cpu_s)
