"""The protocol that makes a study blind: first the code is hashed, then a seed is drawn, then the truth is sealed.

`protocol.json` contains the hashes of the code and of the thresholds of discovery, the master seed and the hash of
`truth.json`; both files are finished before discovery sees the first data set, and only the scorer opens the truth.
"""

import hashlib
import json
import secrets
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from rearl_jax.blind.broad import broad_truth
from rearl_jax.blind.cases import Case
from rearl_jax.blind.sumo import sumo_truth
from rearl_jax.blind.traffic.dataset import hidden_truth
from rearl_jax.blind.traffic.priors import PRIORS
from rearl_jax.blind.traffic.simulation import simulate
from rearl_jax.code_version import code_hash
from rearl_jax.config.blind import BlindConfig, StudyPriors
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.whole_files import replacing

PROTOCOL, TRUTH, UNSEALED = "protocol.json", "truth.json", "unsealed"


@dataclass(frozen=True)
class Protocol:
    """Record of everything that was fixed before discovery started.

    Attributes:
        code_hash: Hash of the sources, generator and discovery.
        config_hash: Hash of the study's configuration.
        seed_drawn: Whether the master seed was drawn, not given.
        master_seed: Master seed of all data sets; None until the code hash is stored.
        truth_sha256: SHA-256 of the sealed truth; None until it is sealed.
        thresholds_hash: Hash of all thresholds of discovery; None in protocols without it.
        priors_hash: Hash of the broad priors with their width; None without them.
    """

    code_hash: str
    config_hash: str
    seed_drawn: bool
    master_seed: int | None = None
    truth_sha256: str | None = None
    thresholds_hash: str | None = None
    priors_hash: str | None = None


def open_protocol(folder: Path, config_hash: str, blind: BlindConfig) -> tuple[Protocol, bool]:
    """The protocol of a study, and whether an earlier run is continued.

    A study with different code, thresholds or configuration starts from the beginning.
    """
    path = folder / PROTOCOL
    seed, is_broad = blind.seed, blind.priors is StudyPriors.broad
    fresh = Protocol(
        code_hash(),
        config_hash,
        seed_drawn=seed is None,
        thresholds_hash=THRESHOLDS.fingerprint(),
        priors_hash=PRIORS.widened(blind.width).fingerprint() if is_broad else None,
    )
    stored = stored_protocol(folder)
    if stored is not None and _fixed(stored) == _fixed(fresh):
        is_continued = stored.truth_sha256 is not None
        if stored.master_seed is not None:
            return stored, is_continued
    # The code hash is stored before the seed is drawn, so that the seed cannot be chosen to suit the code.
    _write(path, fresh)
    drawn = replace(fresh, master_seed=secrets.randbits(32) if seed is None else seed)
    _write(path, drawn)
    return drawn, False


def _fixed(protocol: Protocol) -> tuple[str | None, ...]:
    """Fields that must be equal for a study to be continued."""
    return protocol.code_hash, protocol.config_hash, protocol.thresholds_hash, protocol.priors_hash


def stored_protocol(folder: Path) -> Protocol | None:
    """The protocol of a folder; None without a readable one."""
    try:
        return Protocol(**json.loads((folder / PROTOCOL).read_text(encoding="utf-8")))
    except (FileNotFoundError, ValueError, TypeError):
        return None


def seal(folder: Path, protocol: Protocol, truths: Mapping[str, Any]) -> Protocol:
    """Writes the truth, and the protocol with its hash."""
    content = (json.dumps(truths, indent=1, sort_keys=True, allow_nan=False) + "\n").encode()
    with replacing(folder / TRUTH) as unfinished:
        unfinished.write_bytes(content)
    shutil.rmtree(folder / UNSEALED, ignore_errors=True)
    sealed = replace(protocol, truth_sha256=hashlib.sha256(content).hexdigest())
    _write(folder / PROTOCOL, sealed)
    return sealed


def unsealed_truth(folder: Path, protocol: Protocol, case: Case) -> dict[str, Any]:
    """The truth of a data set, kept until all are sealed so that an interrupted study continues."""
    path = folder / UNSEALED / f"{case.name}.json"
    fixed = [*_fixed(protocol), protocol.master_seed]
    if path.is_file():
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["protocol"] == fixed:
            return stored["truth"]
    truth = truth_of(case)
    with replacing(path) as unfinished:
        unfinished.write_text(json.dumps({"protocol": fixed, "truth": truth}, allow_nan=False), encoding="utf-8")
    return truth


def open_truth(folder: Path, protocol: Protocol) -> dict[str, Any]:
    """The truth of every data set by its name.

    Raises:
        ValueError: The truth differs from the sealed one.
    """
    path = folder / TRUTH
    content = path.read_bytes()
    if hashlib.sha256(content).hexdigest() != protocol.truth_sha256:
        remedy = f"remove {folder} and run the study again"
        raise InvalidInputError(Problem("truth-changed", "was changed after it was sealed", remedy, file=str(path)))
    return json.loads(content)


def truth_of(case: Case) -> dict[str, Any]:
    """The truth of a data set: hidden effects, set, kind."""
    if case.source == "broad":
        hidden = broad_truth(case)
    elif case.source == "sumo":
        hidden = sumo_truth(case.variant)
    else:
        hidden = hidden_truth(case.scenario, simulate(case.scenario))
    described = {"group": case.group, "variant": case.variant, "source": case.source, "seed": case.seed}
    return described | {"changes": dict(case.changes)} | hidden


def _write(path: Path, protocol: Protocol) -> None:
    with replacing(path) as unfinished:
        unfinished.write_text(json.dumps(asdict(protocol), indent=1) + "\n", encoding="utf-8")
