"""The documents of a finished `rearl discover` and `rearl discover blind`."""

from rearl_jax.blind import document as blind
from rearl_jax.discovery.report import document as discovery
from rearl_jax.document.document import Document
from rearl_jax.report.finished import FinishedStudy

_VERDICT = ("verdict", "effects", "candidates", "unseen", "error", "adequacy", "lane_choice", "data")
_MAPS = ("model", "variable", "acts_on", "share", "gain", "selected", "shape")
_PROTOCOL = ("code_hash", "seed_drawn", "master_seed", "truth_sha256")
_SUMMARY = ("n_right", "n_cases", "n_drawn", "oracle_share", "n_oracles", "median_seconds")


def discovery_document(study: FinishedStudy) -> Document:
    """The document of a discovery.

    Raises:
        FileNotFoundError, ValueError: verdict.json is missing, or of an older version.
    """
    verdict, maps = study.object("verdict.json"), None
    study.needs(verdict, _VERDICT, "verdict.json")
    if (study.path / "maps.parquet").exists():  # not written if discover.page is false
        maps = study.table("maps")
        study.needs(maps, _MAPS, "maps.parquet")
    return discovery.document_of(study.config, verdict, maps)


def blind_document(study: FinishedStudy) -> Document:
    """The document of a blind study.

    Raises:
        FileNotFoundError, ValueError: A file is missing, or of an older version.
    """
    (summary,) = study.rows
    study.needs(summary, _SUMMARY, "summary.json")
    protocol = study.object("protocol.json")
    study.needs(protocol, _PROTOCOL, "protocol.json")
    written = [name for name in blind.TABLES if name != blind.STRATA or summary.get(blind.STRATA)]
    return blind.document_of(summary, {name: study.table(name) for name in written}, protocol)
