"""Figures of the evidence for effects, errors of the report drivers, innovations, drivers' parameters, and an example
drive.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Bool, Int
from scipy.stats import norm

from rearl_jax.discovery.observe.candidates import Term
from rearl_jax.discovery.observe.drivers import Prior
from rearl_jax.discovery.observe.residuals import Residuals
from rearl_jax.discovery.report.errors import ModelErrors
from rearl_jax.discovery.report.words import described
from rearl_jax.discovery.search.null import Null
from rearl_jax.discovery.thresholds import THRESHOLDS
from rearl_jax.drawing import BLUE, DARK_GREY, FONT_SIZE, GREY, LIGHT_GREY, VERMILION, panels, png, set_title

COLOURS = {"before": VERMILION, "after": BLUE}

MAX_CANDIDATES = 14
"""Number of candidates that are drawn at most."""

LARGEST_INNOVATION = 5.0
"""Largest absolute innovation that is drawn, in standard deviations [-]."""


def draw_evidence(rows: Sequence[Mapping[str, Any]], null: Null, *, generated: bool) -> bytes:
    """PNG of the evidence for each candidate (`rows`, as in the verdict), of its gains, and of the range of evidence
    that occurs by chance; no range is drawn for candidates that the null distribution does not contain.
    """
    shown, threshold = rows[:MAX_CANDIDATES], null.threshold(THRESHOLDS.candidate_z_score)
    terms = [Term(row["name"], row["variables"][0] if row["kind"] == "generic" else None) for row in shown]
    bands = {place: (null.mean[term], threshold[term]) for place, term in enumerate(terms) if term in threshold}
    figure, (axes,) = panels(7.2, 1.2 + 0.26 * max(len(shown), 3), generated=generated)
    for name, label, colour, marker, size, fill in (
        ("evidence", "evidence in the screening", DARK_GREY, "o", 5, DARK_GREY),
        ("gain", "gain when fitted", VERMILION, "s", 4.5, "none"),
        ("check", "gain on other drivers", BLUE, "D", 4.5, "none"),
    ):
        values = [np.nan if row[name] is None else row[name] for row in shown]
        axes.plot(values, range(len(shown)), marker, color=colour, markersize=size, mfc=fill, label=label, zorder=3)
    widths, lefts = [high - low for low, high in bands.values()], [low for low, _ in bands.values()]
    axes.barh(list(bands), widths, 0.9, lefts, color=LIGHT_GREY, label="range by chance", zorder=0)
    axes.set_yticks(range(len(shown)), [described(row) for row in shown])
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.set_xscale("symlog", linthresh=10)
    low, high = axes.get_xlim()
    axes.set_xlim(min(low, -10.0), max(high, 20.0))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.grid(axis="y", color=LIGHT_GREY, linewidth=0.5)
    axes.set_xlabel("nats (linear up to 10)")
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return png(figure)


def draw_errors(errors: Mapping[str, ModelErrors], *, generated: bool) -> bytes:
    """PNG of the closed-loop gap error of every report driver before and after.

    The noise floor is drawn, too: the error that the driver's own noise alone causes.
    """
    before = errors["before"].by_driver["gap_rmse"]
    last = "after" if "after" in errors else "before"
    floor, order = errors[last].floor, np.argsort(before)
    places = np.arange(len(before))
    figure, (axes,) = panels(7.2, 3.4, generated=generated)
    axes.plot(
        places, floor[order], "_", color=GREY, markersize=6, markeredgewidth=1.5, label="drivers' own noise alone"
    )
    axes.plot(places, before[order], "o", color=VERMILION, markersize=4, label="before")
    if last == "after":
        after = errors[last].by_driver["gap_rmse"][order]
        axes.vlines(places, after, before[order], color=GREY, linewidth=0.7, zorder=0)
        axes.plot(places, after, "o", color=BLUE, markersize=4, label="after")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.tick_params(axis="y", which="minor", labelsize=6)
    axes.set(xlabel="report drivers, by error before", ylabel="closed-loop gap error [m]")
    axes.legend(frameon=False, fontsize=FONT_SIZE)
    return png(figure)


def draw_innovations(residuals: Mapping[str, Residuals], *, generated: bool) -> bytes:
    """PNG of the innovations (prediction errors of the observer): their autocorrelation and distribution."""
    figure, (lags, distribution) = panels(7.2, 3.0, columns=2, generated=generated)
    for model, of_model in residuals.items():
        data = of_model.state.data
        lags.plot(*of_model.autocorrelation(), color=COLOURS[model], linewidth=1.4, label=model)
        used = of_model.innovation[data.weight > 0]
        edges = np.linspace(-LARGEST_INNOVATION, LARGEST_INNOVATION, 41)
        density = np.histogram(used / used.std(), edges, density=True)[0]
        distribution.stairs(np.maximum(density, 1e-6), edges, color=COLOURS[model], linewidth=1.4, label=model)
        if model == "before":
            limit = 1.96 / np.sqrt(max(data.weight.sum(), 1.0))
            lags.axhspan(-limit, limit, color=LIGHT_GREY, zorder=0, label="white noise, 95 %")
    middle = np.linspace(-LARGEST_INNOVATION, LARGEST_INNOVATION, 101)
    distribution.plot(middle, norm.pdf(middle), "--", color=DARK_GREY, linewidth=1.0, label="normal")
    distribution.set(xlabel="innovation / its standard deviation [-]", ylabel="density [-]")
    distribution.set(yscale="log", ylim=(1e-5, 1))
    lags.set(xlabel="time apart [s]", ylabel="autocorrelation [-]")
    low, high = lags.get_ylim()
    lags.set_ylim(min(low, -0.1), max(high, 0.1))
    for panel in (lags, distribution):
        panel.legend(frameon=False, fontsize=8)
    return png(figure)


def draw_parameters(table: pd.DataFrame, prior: Prior, *, generated: bool) -> bytes:
    """PNG of the fitted drivers' own parameters; `table` has the columns of drivers.parquet."""
    figure, axes = panels(7.2, 2.6, columns=prior.size, generated=generated)
    models = [model for model in COLOURS if model in set(table["model"])]
    for panel, name, unit in zip(axes, prior.names, prior.units, strict=True):
        for place, model in enumerate(models):
            part = table.loc[table["model"] == model]
            values = part[name].to_numpy()
            ranks = np.argsort(np.argsort(values))  # drivers side by side, the smallest value on the left
            beside = place + 0.5 * (ranks / max(len(values) - 1, 1) - 0.5)
            truck = part["truck"].to_numpy(bool)
            panel.plot(beside[~truck], values[~truck], "o", color=COLOURS[model], markersize=2.5)
            panel.plot(beside[truck], values[truck], "s", color=COLOURS[model], markersize=4, mfc="none")
            panel.hlines(np.median(values), place - 0.32, place + 0.32, color=DARK_GREY, linewidth=1.2)
        panel.set_xticks(range(len(models)), models)
        panel.set_xlim(-0.5, len(models) - 0.5)
        panel.set_ylim(bottom=0)
        panel.set_title(f"{name.replace('_', ' ')} [{unit.replace('^2', '²')}]", loc="left", fontsize=8)
    return png(figure)


def draw_example(residuals: Mapping[str, Residuals], errors: Mapping[str, ModelErrors], *, generated: bool) -> bytes:
    """PNG of one report driver: measured gap, simulated gap before and after, and acceleration residual."""
    piece = example_piece(residuals["before"], errors)
    figure, (above, below) = panels(7.2, 4.2, rows=2, generated=generated)
    data = residuals["before"].state.data
    rows, begins = stretches(data.weight[:, piece] > 0, data.stride)
    time, leader = data.surroundings.time[rows, piece], data.leader[rows, piece]
    gap = data.gap[rows, piece]
    # NaN interrupts the line at changes of leader.
    measured = np.where(begins | np.r_[False, leader[1:] != leader[:-1]], np.nan, gap)
    above.plot(time, measured, color=DARK_GREY, linewidth=2.0, label="measured")
    for model, of_model in residuals.items():
        # `gap` is the simulated minus the measured gap; the simulated gap has no measurement noise.
        noise = of_model.state.data.y[rows, piece] - of_model.state.data.smooth[rows, piece]
        above.plot(
            time,
            measured + of_model.gap[rows, piece] - noise,
            color=COLOURS[model],
            linewidth=1.3,
            label=f"simulated {model}",
        )
        acceleration = np.where(begins, np.nan, of_model.acceleration[rows, piece])
        below.plot(time, acceleration, color=COLOURS[model], linewidth=1.2)
    below.axhline(0.0, color=GREY, linewidth=0.8)
    above.set_ylabel("gap [m]")
    above.set_ylim(bottom=0)
    above.legend(frameon=False, fontsize=FONT_SIZE, ncols=3)
    below.set(xlabel="time [s]", ylabel="acceleration residual [m/s²]")
    set_title(above, f"report driver {data.driver[piece]}, the one with the median change of the error")
    return png(figure)


def stretches(
    counts: Bool[np.ndarray, " steps"], stride: int
) -> tuple[Int[np.ndarray, " counted"], Bool[np.ndarray, " counted"]]:
    """Indices of the time steps of a piece (part of a track) that count, and whether a gap precedes each of them: a
    distance of more than `stride`, the time steps from one independent measurement to the next.
    """
    rows = np.flatnonzero(counts)
    return rows, np.diff(rows, prepend=rows[:1]) > stride


def example_piece(residuals: Residuals, errors: Mapping[str, ModelErrors]) -> int:
    """Index of the longest piece of an example driver.

    It is the driver with the median change of the error or, if no effect was added, with the median error.
    """
    before = errors["before"].by_driver["gap_rmse"]
    change = before - errors["after"].by_driver["gap_rmse"] if "after" in errors else before
    driver = int(np.argsort(change)[len(change) // 2])
    pieces = np.flatnonzero(residuals.state.data.driver == driver)
    return int(pieces[residuals.state.data.weight[:, pieces].sum(axis=0).argmax()])
