"""Configuration of the language model: prompt, server, error handling.

Defaults marked "REARL" are stated in the paper (Bi et al.).
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.config._ranges import check_finite, check_least, check_positive
from rearl_jax.problems import out_of_range


class Profile(Enum):
    """Server software, which determines the extensions of the chat completions interface."""

    auto = "auto"
    """Detected by a request."""
    vllm = "vllm"
    sglang = "sglang"
    ollama = "ollama"
    llamacpp = "llamacpp"
    plain = "plain"
    """No extensions of OpenAI's interface."""


class Thinking(Enum):
    """Reasoning before the answer."""

    off = "off"
    """Switched off if the server can, and removed from the answer."""
    on = "on"
    """Left on and removed from the answer; needs a large max_tokens."""
    none = "none"
    """The model has no reasoning; nothing about it is sent."""


@dataclass(unsafe_hash=True)
class PromptConfig:
    """Prompt of the language model"""

    template: str = key("", "Jinja file with the blocks system and user; empty = the shipped one")
    next: bool = key(
        True, "include the action of each vehicle of the reference in the next second; false = REARL's Eq. 9"
    )
    scene: bool = key(True, "include speed shares and mean spacing of scenario and reference")


@dataclass(unsafe_hash=True)
class LlmConfig:
    """Language model behind decision.policy=llm"""

    model: str = key("", "name of the model; empty = the only one on the server")
    profile: Profile = key(
        Profile.auto, "server software, for its extensions: auto, vllm, sglang, ollama, llamacpp, plain (none)"
    )
    api_key_env: str = key("REARL_API_KEY", "environment variable with the API key; unset = no key is sent")
    temperature: float = key(0.0, "sampling temperature")
    seed: int = key(0, "seed of the server's sampling; each vote adds its number")
    votes: int = key(1, "answers per question, 1 or 3; the majority decides")
    thinking: Thinking = key(Thinking.off, "off, on, none: reasoning before the answer")
    constrained: bool = key(
        True, "let the server restrict answers to admissible identifiers if it can; never with thinking=on"
    )
    max_tokens: int = key(8, "longest answer [tokens]; thousands with thinking=on")
    max_in_flight: int = key(
        48, "simultaneous requests; more than the server processes at a time, to keep it busy; 1 or 2 on a CPU"
    )
    startup: float = key(300.0, "longest wait for a server that is still loading [s]")
    connect_timeout: float = key(5.0, "longest time to connect [s]")
    read_timeout: float = key(120.0, "longest time without a byte [s]")
    deadline: float = key(
        600.0, "longest time for all questions of one simulated second; later answers are discarded [s]"
    )
    tries: int = key(3, "attempts before a request counts as failed")
    backoff: float = key(0.5, "pause before the second attempt, doubled each time, with jitter [s]")
    breaker_failures: int = key(8, "consecutive failed requests after which the server counts as down")
    breaker_pause: float = key(10.0, "pause before the next request to a server that is down [s]")
    cache: str = key("", "SQLite file of the answers, on a local disk; empty = answers.sqlite in the cache folder")

    def check(self) -> None:
        if self.votes not in (1, 3):
            raise out_of_range("votes", "must be 1 or 3", self.votes)
        check_least(self, 1, "max_tokens", "max_in_flight", "tries", "breaker_failures")
        check_positive(self, "connect_timeout", "read_timeout", "deadline")
        check_least(self, 0, "temperature", "startup", "backoff", "breaker_pause")
        check_finite(self, "temperature", "backoff", "breaker_pause")
        if self.thinking is Thinking.on and self.max_tokens < 256:
            message = "must be larger for thinking=on, such as 4096"
            raise out_of_range("max_tokens", message, self.max_tokens)
