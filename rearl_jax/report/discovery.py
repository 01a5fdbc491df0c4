"""The documents of a finished `rearl discover` and `rearl discover blind`.

A study is blind if discovery is not told which effects the generator has hidden in its data sets. Both functions raise
FileNotFoundError or ValueError if a file is missing, or of an older version.
"""

from rearl_jax.blind import document as blind
from rearl_jax.discovery.report import document as discovery
from rearl_jax.document.document import Document
from rearl_jax.report.finished import FinishedStudy

_VERDICT_KEYS = ("verdict", "effects", "candidates", "unseen", "error", "adequacy", "lane_choice", "data")
"""Required keys of verdict.json."""

_MAP_COLUMNS = ("model", "variable", "acts_on", "share", "gain", "selected", "shape")
"""Required columns of maps.parquet; a map is the unexplained acceleration as a function of one variable."""

_PROTOCOL_KEYS = ("code_hash", "seed_drawn", "master_seed", "truth_sha256")
"""Required keys of protocol.json of a blind study."""

_SUMMARY_KEYS = ("n_right", "n_cases", "n_drawn", "oracle_share", "n_oracles", "median_seconds")
"""Required keys of summary.json of a blind study."""


def discovery_document(study: FinishedStudy) -> Document:
    """The document of a discovery."""
    verdict = study.object("verdict.json", _VERDICT_KEYS)
    # Maps are not written if discover.page is false.
    maps = study.table("maps", _MAP_COLUMNS) if study.has_table("maps") else None
    return discovery.document_of(study.config, verdict, maps)


def blind_document(study: FinishedStudy) -> Document:
    """The document of a blind study."""
    summary, protocol = study.summary(_SUMMARY_KEYS), study.object("protocol.json", _PROTOCOL_KEYS)
    # The table of strata is written for studies with broad priors only.
    written = [name for name in blind.TABLES if name != blind.STRATA or summary.get(blind.STRATA)]
    return blind.document_of(summary, {name: study.table(name) for name in written}, protocol)
