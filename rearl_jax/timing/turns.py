"""Programs measured in turn.

Within a repetition the programs run one after the other, in the reverse order the next time, so that other load on
the machine affects all of them equally.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TypeAlias

from rearl_jax.progress import progress_bar
from rearl_jax.timing.measurement import Measurement, Series, Simulator

Report: TypeAlias = Callable[[str, int], None]
"""Callback with the next step in words, and the number of steps done since the last call."""


@contextmanager
def reporting(n_steps: int) -> Iterator[Report]:
    """A progress bar of `n_steps` steps."""
    with progress_bar() as bar:
        line = bar.add_task("starting", total=n_steps)
        yield lambda doing, advance: bar.update(line, description=doing, advance=advance)


def warm_up(sessions: Mapping[str, Simulator], seed: int, label: str, report: Report) -> dict[str, Measurement]:
    """A first measurement of each program, with as many scenarios as it simulates at a time."""
    first = {}
    for name, session in sessions.items():
        report(f"{label}: {name}, warming up", 0)
        first[name] = session.measure(int(session.facts["unit"]), seed)
        report(f"{label}: {name}, warmed up", 1)
    return first


def take_turns(
    sessions: Mapping[str, Simulator],
    n_vehicles: int,
    n_scenarios: Mapping[str, int],
    repetitions: int,
    seed: int,
    label: str,
    report: Report,
) -> dict[str, Series]:
    """The series of each program; all programs get the same scenes in a repetition, new ones in the next."""
    measured: dict[str, list[Measurement]] = {name: [] for name in sessions}
    for repetition in range(repetitions):
        for name in list(sessions) if repetition % 2 == 0 else list(sessions)[::-1]:
            report(f"{label}: {name}, {repetition + 1} of {repetitions}", 0)
            measured[name].append(sessions[name].measure(n_scenarios[name], seed + 1 + repetition))
            report(f"{label}: {name}, {repetition + 1} of {repetitions}", 1)
    return {name: Series(name, n_vehicles, tuple(runs), sessions[name].facts) for name, runs in measured.items()}
