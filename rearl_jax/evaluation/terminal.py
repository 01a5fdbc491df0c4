"""Figures in a narrow table."""

from rearl_jax.evaluation.tables import written


def short(value: float, name: str) -> str:
    """A figure without the zero before its point, so that eight metrics fit side by side."""
    text = written(value, name)
    return text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text
