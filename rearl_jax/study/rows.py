"""The rows of Table 1 as data: changes to the configuration of `rearl evaluate`, and the corresponding row in the
paper.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum
from typing import Any, TypeVar

from rearl_jax.config import EvaluateTask, StudyTable1Task
from rearl_jax.config._schema import nearest
from rearl_jax.config.driver import DEFAULT, record_of
from rearl_jax.config.mobil import MobilConfig
from rearl_jax.config.study import Table1Config
from rearl_jax.problems import InvalidInputError, Problem
from rearl_jax.study.parts import part_record

Record = TypeVar("Record")


class Role(Enum):
    """Comparisons of a row."""

    method = "method"
    """With base."""
    matcher = "matcher"
    """With base and with the controls."""
    control = "control"
    """With base; it shows what the matcher's choices are worth."""


@dataclass(frozen=True)
class Row:
    """A row of the table.

    Attributes:
        name: Name in `table1.rows` and of the folder of the row.
        title: Title in tables and figures.
        changes: Values of keys, as written on the command line.
        paper: Corresponding row of `published.TABLE1`; None if there is none.
        role: Comparisons of the row.
        asks_model: Whether a language model is used.
        is_repaired: Whether the traffic is that of a repaired model, not highway-env's.
    """

    name: str
    title: str
    changes: Mapping[str, Any]
    paper: str | None = None
    role: Role = field(default=Role.method, kw_only=True)
    asks_model: bool = field(default=False, kw_only=True)
    is_repaired: bool = field(default=False, kw_only=True)


def _loop(policy: str, **other: Any) -> dict[str, Any]:
    """Values of keys for REARL with a policy; a double underscore stands for the dot in the name of a key."""
    return {"method": "rearl", "decision.policy": policy} | {key.replace("__", "."): v for key, v in other.items()}


CONTROL = "control: "
"""Prefix of the titles of controls."""

_PAPER_REARL = "rearl_qwen3_32b"

ROWS = (
    Row("base", "base", {"method": "base"}, "base"),
    Row("ppo", "PPO", {"method": "ppo"}, "ppo"),
    Row("critical_stats", "CRITICAL, stats", {"method": "critical", "critical.proposer": "stats"}, "critical"),
    Row("critical_search", "CRITICAL, search", {"method": "critical", "critical.proposer": "search"}, "critical"),
    Row(
        "critical_llm",
        "CRITICAL, language model",
        {"method": "critical", "critical.proposer": "llm"},
        "critical",
        asks_model=True,
    ),
    Row("matcher_raw", "REARL, matcher raw", _loop("matcher", matcher__space="raw"), _PAPER_REARL, role=Role.matcher),
    Row(
        "matcher_rank", "REARL, matcher rank", _loop("matcher", matcher__space="rank"), _PAPER_REARL, role=Role.matcher
    ),
    Row(
        "matcher_drawn",
        "REARL, matcher rank, drawn",
        _loop("matcher", matcher__space="rank", reference__mode="drawn"),
        _PAPER_REARL,
    ),
    Row("llm", "REARL, language model", _loop("llm"), _PAPER_REARL, asks_model=True),
    Row("idle", CONTROL + "idle", _loop("idle"), role=Role.control),
    Row("random_admissible", CONTROL + "random action", _loop("random_admissible"), role=Role.control),
    Row("matcher_random_ref", CONTROL + "random reference", _loop("matcher_random_ref"), role=Role.control),
    Row("calibrated", "calibrated drivers", {"method": "base", "variant": "calibrated"}, is_repaired=True),
    Row("repaired", "repaired model", {"method": "base", "variant": "repaired"}, is_repaired=True),
    Row(
        "repaired_matcher",
        "repaired model, REARL, matcher rank",
        _loop("matcher", matcher__space="rank") | {"variant": "repaired"},
        is_repaired=True,
    ),
)
"""All rows, in the order of the table."""


def chosen_rows(table1: Table1Config, model: str | None = None) -> list[Row]:
    """The requested rows, in the order of the table.

    Raises:
        ValueError: A chosen row does not exist or needs a model.
    """
    by_name = {row.name: row for row in ROWS}
    if table1.rows is None:
        return [row for row in ROWS if (table1.llm or not row.asks_model) and (model or not row.is_repaired)]
    for name in table1.rows:
        if name not in by_name:
            message = f"must be among {', '.join(by_name)}; nearest: {nearest(name, by_name)}"
            raise InvalidInputError(Problem("choice-unknown", message, key="table1.rows", value=name))
        if by_name[name].is_repaired and model is None:
            message = f"must be MODEL.YAML for the row {name}, which is on the traffic of a repaired model"
            raise InvalidInputError(Problem("key-missing", message, key="model"))
    return [row for row in ROWS if row.name in table1.rows or (table1.llm and row.asks_model)]


def row_record(row: Row, config: StudyTable1Task) -> EvaluateTask:
    """The evaluation behind a row.

    A language model is queried less often and in fewer rollouts, see the group table1.
    """
    record = part_record(EvaluateTask, config, f"{config.table1.kept_in or config.study}/rows/{row.name}")
    changes = dict(row.changes)
    if not row.is_repaired:
        changes["model"] = None
    if row.is_repaired or changes.get("method") in ("ppo", "critical"):
        changes["driver"] = record_of(DEFAULT)()  # these rows have their own drivers
    if changes.get("method") in ("ppo", "critical"):
        changes["mobil"] = MobilConfig()
    if row.asks_model and changes["method"] == "rearl":
        changes |= {
            "detection.interval": config.table1.llm_interval,
            "eval.n_runs": config.table1.llm_runs,
            "eval.seed_scope": "run",
        }
    for key, value in changes.items():
        record = changed(record, key, value)
    return record


def changed(record: Record, key: str, value: Any) -> Record:
    """The record with another value under a key such as `eval.n_runs`; enumerations by name.

    Raises:
        ValueError: There is no such key or value.
    """
    name, _, rest = key.partition(".")
    if name not in {item.name for item in fields(record)}:  # type: ignore[arg-type]
        raise InvalidInputError(Problem("key-unknown", f"is not a key of {type(record).__name__}", key=name))
    old = getattr(record, name)
    if rest:
        value = changed(old, rest, value)
    elif isinstance(old, Enum):
        if value not in type(old).__members__:
            message = f"must be one of {', '.join(type(old).__members__)}"
            raise InvalidInputError(Problem("choice-unknown", message, key=key, value=value))
        value = type(old)[value]
    return replace(record, **{name: value})  # type: ignore[type-var]
