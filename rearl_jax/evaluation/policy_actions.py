"""Actions of a policy that drives all vehicles, by speed: counts, one sentence and a figure."""

import numpy as np
from jaxtyping import Float, Int

from rearl_jax.baselines.weights import TrainedPolicy
from rearl_jax.config.decision import Longitudinal
from rearl_jax.decision.situation import ACTION_NAMES
from rearl_jax.evaluation.extras import Extra

_SPEED_CONTROL = {
    Longitudinal.mdp: "target speeds followed without regard to the vehicle ahead, as by highway-env's MDPVehicle",
    Longitudinal.idm_capped: "target speeds followed no faster than IDM allows",
}


def count_actions(
    actions: Int[np.ndarray, "seconds vehicles scenarios"],
    speed: Float[np.ndarray, "seconds vehicles scenarios"],
    edges: Float[np.ndarray, " edges"],
) -> Int[np.ndarray, "actions bins"]:
    """Counts of each action in each bin of the speed before the action, in the order of `MetaAction`.

    The first second is left out, because no frame shows the speed before its actions. Speeds outside the edges count
    in the outermost bins.

    Args:
        actions: Actions followed during each second, NO_ACTION for none.
        speed: Speed at the end of each second [m/s].
        edges: Edges of the bins [m/s].
    """
    before = np.clip(speed[:-1], edges[0], edges[-1])
    counts = [np.histogram(before[actions[1:] == number], edges)[0] for number in range(len(ACTION_NAMES))]
    return np.stack(counts)


def driving_extra(
    policy: TrainedPolicy,
    counts: Int[np.ndarray, "actions bins"],
    edges: Float[np.ndarray, " edges"],
    method: str,
    *,
    generated: bool,
) -> Extra:
    """Note and figure; arguments as in `driving_note` and `figures.draw_actions`."""

    def draw() -> bytes:
        from rearl_jax.evaluation.figures import draw_actions

        return draw_actions(counts, edges, method, generated=generated)

    return Extra(notes=(driving_note(policy, counts),), figures={"actions_by_speed": draw})


def driving_note(policy: TrainedPolicy, counts: Int[np.ndarray, "actions bins"]) -> str:
    """One sentence about the policy and its actions."""
    shares = counts.sum(axis=1) / max(counts.sum(), 1)
    done = ", ".join(f"{name} {100 * share:.1f} %" for name, share in zip(ACTION_NAMES, shares, strict=True))
    return (
        f"weights {policy.file} ({policy.digest}), trained on {policy.car_steps:,} vehicle-seconds without recordings; "
        f"{_SPEED_CONTROL[policy.options.longitudinal]}; actions: {done}"
    )
