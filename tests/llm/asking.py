"""Questions and configurations for the tests of the client, and processes that ask at the same time."""

import subprocess
import sys
from pathlib import Path

from rearl_jax.config.llm import LlmConfig, Profile
from rearl_jax.llm.records import Answer, Message, Question

SYSTEM = Message("system", "Steer the car. Reply with one identifier.")
SECRET = "sk-3f9a71c2d5e84b60"
"""Key of a server, which must appear nowhere."""

CHOICES = (0, 1, 3, 4)
"""Admissible actions of every question; without 2, so that some answers of the stub (0 to 4) are not admissible."""


def make_questions(number: int, tag: str = "", first: int = 0) -> list[Question]:
    """`number` different questions, ten per scenario, from number `first` on; `tag` begins their text."""
    return [
        Question(i // 10, i % 10, (SYSTEM, Message("user", f"{tag} scenario {i // 10} car {i % 10}")), CHOICES)
        for i in range(first, first + number)
    ]


def make_config(folder: Path, **changes) -> LlmConfig:
    """A configuration for the stub server: short pauses between tries, answers stored in `folder`, no constraint."""
    defaults = {
        "cache": str(folder / "answers.sqlite"),
        "profile": Profile.vllm,
        "constrained": False,
        "backoff": 0.01,
        "read_timeout": 20.0,
        "deadline": 60.0,
        "breaker_failures": 1000,
        "api_key_env": "",
    }
    return LlmConfig(**(defaults | changes))


def outcomes(answers: list[Answer]) -> list[tuple[int, str, str]]:
    """Results that must be the same in every run: action, cause, digest."""
    return [(answer.action, answer.cause.name, answer.digest) for answer in answers]


def run_together(program: str, *arguments: list[str]) -> list[str]:
    """What processes print that run a program with these words: each prints `ready`, then waits for a line."""
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    processes = [subprocess.Popen([sys.executable, "-c", program, *words], text=True, **pipes) for words in arguments]
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    printed = []
    for process in processes:
        out, error = process.communicate(timeout=60)
        assert process.returncode == 0, error
        printed.append(out)
    return printed
