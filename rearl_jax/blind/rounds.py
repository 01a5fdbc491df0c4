"""Runs of a blind study: generates each data set, runs discovery, keeps the verdict; an interrupted study continues.

The name of a data set's folder carries no information; the folder is deleted once its verdict is stored. Discovery
receives the folder and a name for its results, never the case.
"""

import json
import logging
import math
import shutil
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from rearl_jax.blind import sealing
from rearl_jax.blind.broad import write_broad
from rearl_jax.blind.cases import Case, list_cases
from rearl_jax.blind.judging import judge, recoveries
from rearl_jax.blind.questions import Judged
from rearl_jax.blind.sumo import check_sumo, write_sumo_dataset
from rearl_jax.blind.traffic.catalogue import LISTED
from rearl_jax.blind.traffic.dataset import write_dataset
from rearl_jax.blind.traffic.drawing import SUMO_BASES
from rearl_jax.blind.verdicts import failed_verdict, read_verdict
from rearl_jax.config.blind import BlindConfig
from rearl_jax.whole_files import replacing

log = logging.getLogger(__name__)

VERDICTS, DATA = "verdicts", "data"
"""Folders of a study."""

FAILURES = (ValueError, ArithmeticError, RuntimeError)
"""Exceptions of discovery on a data set that do not end the study; each is stored and counted."""

FITTED_ARTEFACTS = ("lens", "clock_offset")
"""Artefacts that are fitted; all others are found in the columns without a fit."""

Watch = Callable[[int, int], None]
"""Called with the steps done and their total."""


@runtime_checkable
class Discover(Protocol):
    """Interface of discovery for a study."""

    def __call__(self, folder: Path, study: str, oracle: str | None = None) -> dict[str, Any]:
        """The verdict on the recordings in a folder, as in verdict.json.

        Args:
            folder: Folder of canonical tables.
            study: Name of the folder of its results, under results.root.
            oracle: Name of the true effect, given after the verdict is fixed, for a refit that yields `error.oracle`.
        """
        ...


def open_study(folder: Path, config_hash: str, blind: BlindConfig, watch: Watch) -> tuple[sealing.Protocol, list[Case]]:
    """The protocol with the sealed truth, and the data sets; a study of other code or configuration starts from the
    beginning.
    """
    protocol, is_continued = sealing.open_protocol(folder, config_hash, blind)
    assert protocol.master_seed is not None
    cases = list_cases(blind, protocol.master_seed)
    if any(case.source == "sumo" or case.base in SUMO_BASES for case in cases):
        check_sumo()
    if not is_continued:
        if n_lost := len(list((folder / VERDICTS).glob("*.json"))):
            log.warning(
                "code or configuration differ from the earlier run: the study starts again, verdicts removed: %d",
                n_lost,
            )
        shutil.rmtree(folder / VERDICTS, ignore_errors=True)
        truths = {}
        for number, case in enumerate(cases):
            watch(number, len(cases))
            truths[case.name] = sealing.unsealed_truth(folder, protocol, case)
        protocol = sealing.seal(folder, protocol, truths)
    watch(len(cases), len(cases))
    return protocol, cases


def run_cases(
    folder: Path, study: str, cases: Sequence[Case], discover: Discover, blind: BlindConfig, watch: Watch
) -> None:
    """Runs discovery on every data set without a verdict, in the order given; verdicts are written atomically.

    `study` is the name of the folder under results.root.
    """
    for number, case in enumerate(cases):
        watch(number, len(cases))
        verdict, oracle = _files(folder, case)
        name = oracle_name(case) if blind.oracle else None
        if verdict.is_file() and (name is None or oracle.is_file()):
            continue
        data = folder / DATA / case.name
        shutil.rmtree(data, ignore_errors=True)  # left by an interrupted process
        _write_data(case, data)
        if not verdict.is_file():
            _keep(verdict, _ask(discover, data, f"{study}/runs/{case.name}", None))
        if name is not None:
            # Only after the verdict is fixed.
            _keep(oracle, _ask(discover, data, f"{study}/oracles/{case.name}", name))
        if not blind.keep_data:
            shutil.rmtree(data)
    if not blind.keep_data:
        shutil.rmtree(folder / DATA, ignore_errors=True)
    watch(len(cases), len(cases))


def judge_cases(folder: Path, protocol: sealing.Protocol, cases: Sequence[Case]) -> list[Judged]:
    """All verdicts with the truth, which is opened here and nowhere else.

    Raises:
        ValueError: The truth differs from the sealed one, or a verdict is invalid.
    """
    truths = sealing.open_truth(folder, protocol)
    judged = []
    for case in cases:
        path, oracle = _files(folder, case)
        stored = json.loads(path.read_text(encoding="utf-8"))
        if oracle.is_file() and stored["error"]:
            oracle_errors = json.loads(oracle.read_text(encoding="utf-8"))["error"] or {}
            stored["error"]["oracle"] = oracle_errors.get("oracle")
        try:
            verdict = read_verdict(stored)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error
        truth = truths[case.name]
        recovered = tuple(recoveries(truth, verdict))
        covered = [item.is_covered for item in recovered if item.is_covered is not None]
        judged.append(Judged(case.name, truth, verdict, judge(truth, verdict), recovered, len(covered), sum(covered)))
    return judged


def oracle_name(case: Case) -> str | None:
    """The library effect for a refit with the truth; None if the library lacks it or several effects are hidden."""
    if case.source == "sumo" or case.base in SUMO_BASES or len(case.planted) != 1:
        return None
    name = case.planted[0].name
    return name if name in LISTED or name in FITTED_ARTEFACTS else None


def time_left(done_before: int, begin: float) -> Callable[[int, int], str]:
    """Function from the finished and the total number of data sets to the remaining time of a run.

    The run began at `begin` on the clock of time.perf_counter [s], with `done_before` data sets finished.
    """

    def text(done: int, total: int) -> str:
        done_now = done - done_before
        if done_now <= 0 or done >= total:
            return ""
        seconds = (time.perf_counter() - begin) / done_now * (total - done)
        return f", {math.ceil(seconds / 60)} min left" if seconds > 90 else f", {seconds:.0f} s left"

    return text


def count_finished(folder: Path, cases: Sequence[Case]) -> int:
    """Number of data sets with a verdict."""
    return sum(_files(folder, case)[0].is_file() for case in cases)


def _write_data(case: Case, folder: Path) -> None:
    if case.source == "broad":
        write_broad(case, folder)
    elif case.source == "sumo":
        write_sumo_dataset(folder, case.scenario, case.variant)
    else:
        write_dataset(folder, case.scenario)


def _ask(discover: Discover, data: Path, study: str, oracle: str | None) -> dict[str, Any]:
    """The verdict of discovery on a data set; a failure of discovery is a verdict too."""
    begin = time.perf_counter()
    try:
        return discover(data, study, oracle)
    except FAILURES as error:
        log.exception("discovery stopped on %s: %s: %s", data.name, type(error).__name__, error)
        return failed_verdict(f"{type(error).__name__}: {error}", time.perf_counter() - begin)


def _files(folder: Path, case: Case) -> tuple[Path, Path]:
    """Files of the verdict on a data set, and of the refit with its true effect."""
    return folder / VERDICTS / f"{case.name}.json", folder / VERDICTS / f"{case.name}.oracle.json"


def _keep(path: Path, verdict: dict[str, Any]) -> None:
    with replacing(path) as unfinished:
        unfinished.write_text(json.dumps(verdict, indent=1, allow_nan=False) + "\n", encoding="utf-8")
