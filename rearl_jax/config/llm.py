"""Configuration of the language model: what it is shown, where it runs, what may go wrong.

Defaults marked "REARL" are stated in the paper (Bi et al.); "own choice" resolves something it leaves open.
"""

from dataclasses import dataclass
from enum import Enum

from rearl_jax.config._key import key
from rearl_jax.problems import out_of_range


class Profile(Enum):
    """Whose dialect of the chat completions the server speaks."""

    auto = "auto"
    """Found out by asking it."""
    vllm = "vllm"
    sglang = "sglang"
    ollama = "ollama"
    llamacpp = "llamacpp"
    plain = "plain"
    """No extensions: nothing is sent that OpenAI's interface does not have."""


class Thinking(Enum):
    """Whether the model reasons before it answers."""

    off = "off"
    """Switched off where the server can, and stripped from the answer."""
    on = "on"
    """Left on and stripped; needs a large max_tokens."""
    none = "none"
    """The model has none: nothing is sent about it."""


@dataclass(unsafe_hash=True)
class PromptConfig:
    """What the language model is shown"""

    template: str = key("", "Jinja file with the blocks system and user; empty = the shipped one")
    next: bool = key(True, "show what each vehicle of the reference did in the following second; false: REARL's Eq. 9")
    scene: bool = key(True, "show the scenario's speed shares and mean spacing beside the reference's; own choice")


@dataclass(unsafe_hash=True)
class LlmConfig:
    """Language model behind decision.policy=llm"""

    model: str = key("", "name of the model; empty = the only one the server has")
    profile: Profile = key(Profile.auto, "auto, vllm, sglang, ollama, llamacpp, plain: which extensions are used")
    api_key_env: str = key("REARL_API_KEY", "environment variable with the key of the server; unset = none is sent")
    temperature: float = key(0.0, "sampling temperature; own choice")
    seed: int = key(0, "seed of the server's sampling; a vote adds its number")
    votes: int = key(1, "answers asked for per question, 1 or 3; the majority counts")
    thinking: Thinking = key(Thinking.off, "off, on, none: reasoning before the answer")
    constrained: bool = key(
        True, "let the server restrict the answer to admissible identifiers where it can; never with thinking=on"
    )
    max_tokens: int = key(8, "longest answer [tokens]; thousands with thinking=on")
    max_in_flight: int = key(
        48, "requests at a time: more than the server works on at once, or it waits for us; 1 or 2 on a CPU; own choice"
    )
    startup: float = key(300.0, "longest wait for a server that is still loading [s]; own choice")
    connect_timeout: float = key(5.0, "time to connect [s]; own choice")
    read_timeout: float = key(120.0, "time without a byte [s]; own choice")
    deadline: float = key(600.0, "time for all questions of one second; later answers are late [s]; own choice")
    tries: int = key(3, "times a request is sent before it counts as failed; own choice")
    backoff: float = key(0.5, "pause before the second try, doubled each time, with jitter [s]; own choice")
    breaker_failures: int = key(8, "failed requests in a row after which the server counts as down; own choice")
    breaker_pause: float = key(10.0, "pause before a server that is down is tried again [s]; own choice")
    cache: str = key("", "SQLite file of the answers, on a local disk; empty = answers.sqlite in the cache folder")

    def check(self) -> None:
        """Raise InvalidInputError for a value outside its range."""
        if self.votes not in (1, 3):
            raise out_of_range("votes", "must be 1 or 3", self.votes)
        for name in ("max_tokens", "max_in_flight", "tries", "breaker_failures"):
            if getattr(self, name) < 1:
                raise out_of_range(name, "must be at least 1", getattr(self, name))
        for name in ("connect_timeout", "read_timeout", "deadline"):
            if not getattr(self, name) > 0:
                raise out_of_range(name, "must be > 0 s", getattr(self, name))
        for name in ("temperature", "startup", "backoff", "breaker_pause"):
            if not getattr(self, name) >= 0:
                raise out_of_range(name, "must be >= 0", getattr(self, name))
        if self.thinking is Thinking.on and self.max_tokens < 256:
            said = "must be larger for thinking=on, such as 4096"
            raise out_of_range("max_tokens", said, self.max_tokens)
