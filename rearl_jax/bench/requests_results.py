"""What `rearl bench requests` has measured, as a table and as flat figures."""

import json
from dataclasses import dataclass
from statistics import median

import pandas as pd

from rearl_jax.config.bench import BenchRequestsConfig

MEANINGS = {
    "fixed_per_s, server_per_s": "answers per second through our client, median; also _min, _max",
    "{...}_plain_per_s": "responses per second to the plain load generator, median; also _min, _max",
    "{...}_ratio_to_plain": "ours by the plain load generator's, within a repetition, median; also _min, _max",
    "{...}_cpu_ms": "CPU time of our process per request, median [ms]; {...}_plain_cpu_ms: of the load generator",
    "fixed_ideal_per_s": "slots by latency of the server that takes a fixed time",
    "fixed_share_of_ideal": "ours by that, median; fixed_plain_share_of_ideal: the load generator's",
    "server_prompt_tokens, server_cached_tokens": "tokens of our questions, and those found in the prefix cache",
}
"""What the keys of the summary mean."""


@dataclass(frozen=True)
class Burst:
    """Requests sent at once.

    Attributes:
        n_requests: How many.
        wall_s: Until the last answer [s].
        cpu_s: CPU time of the asking process [s].
        prompt_tokens: Tokens of the questions; None where they are not counted.
        cached_tokens: Those in the server's prefix cache; None where they are not counted.
    """

    n_requests: int
    wall_s: float
    cpu_s: float
    prompt_tokens: int | None = None
    cached_tokens: int | None = None

    @property
    def per_s(self) -> float:
        """Requests per second."""
        return self.n_requests / self.wall_s

    @property
    def cpu_ms(self) -> float:
        """CPU time per request [ms]."""
        return 1000 * self.cpu_s / self.n_requests


@dataclass(frozen=True)
class Asking:
    """One server, asked by our client and by the plain load generator, repetition by repetition."""

    address: str
    model: str
    ours: tuple[Burst, ...]
    plain: tuple[Burst, ...]

    @property
    def ratios(self) -> list[float]:
        """Our speed by that of the load generator in every repetition."""
        return [own.per_s / other.per_s for own, other in zip(self.ours, self.plain, strict=True)]

    @property
    def tokens(self) -> tuple[int | None, int | None]:
        """Tokens of all our questions, and those in the prefix cache; None where the server does not say."""
        prompts = [burst.prompt_tokens for burst in self.ours if burst.prompt_tokens is not None]
        cached = [burst.cached_tokens for burst in self.ours if burst.cached_tokens is not None]
        return sum(prompts) if prompts else None, sum(cached) if cached else None


@dataclass(frozen=True)
class RequestsResults:
    """All that was measured; `fixed` is the server of a fixed time, `real` the other one, None where none was named."""

    requests: BenchRequestsConfig
    in_flight: int
    fixed: Asking
    real: Asking | None
    load_average: float | None
    machine: dict

    @property
    def ideal_per_s(self) -> float:
        """Requests per second that the server of a fixed time can answer at most."""
        return self.requests.slots / self.requests.latency

    def table(self) -> pd.DataFrame:
        """One row per server, asker and repetition."""
        rows = []
        for server, asking in (("fixed", self.fixed), ("server", self.real)):
            for asker in () if asking is None else ("ours", "plain"):
                for number, burst in enumerate(getattr(asking, asker)):
                    rows.append({"server": server, "asker": asker, "repetition": number, **vars(burst)})
        frame = pd.DataFrame(rows)
        return frame.astype({"prompt_tokens": "Int64", "cached_tokens": "Int64"})

    def metadata(self) -> dict[str, str]:
        """What the schema of the table says besides its provenance."""
        return {
            "seeds": f"requests.seed={self.requests.seed}",
            "machine": json.dumps(self.machine),
            "definitions": json.dumps(MEANINGS),
        }

    def summary(self) -> dict[str, int | float | str | None]:
        """Flat figures; see `MEANINGS`."""
        ideal = self.ideal_per_s
        figures: dict[str, int | float | str | None] = {"in_flight": self.in_flight, "fixed_ideal_per_s": ideal}
        figures |= _figures("fixed", self.fixed)
        for asker, bursts in (("", self.fixed.ours), ("plain_", self.fixed.plain)):
            figures[f"fixed_{asker}share_of_ideal"] = median(burst.per_s for burst in bursts) / ideal
        if self.real is not None:
            prompt, cached = self.real.tokens
            figures |= _figures("server", self.real)
            figures |= {"server_model": self.real.model, "server_prompt_tokens": prompt, "server_cached_tokens": cached}
        return figures | {"load_average": self.load_average}


def _figures(name: str, asking: Asking) -> dict[str, float]:
    figures = {}
    for asker, bursts in (("", asking.ours), ("plain_", asking.plain)):
        figures |= _spread(f"{name}_{asker}per_s", [burst.per_s for burst in bursts])
        figures[f"{name}_{asker}cpu_ms"] = median(burst.cpu_ms for burst in bursts)
    return figures | _spread(f"{name}_ratio_to_plain", asking.ratios)


def _spread(name: str, values: list[float]) -> dict[str, float]:
    return {name: median(values), f"{name}_min": min(values), f"{name}_max": max(values)}
