"""Environments of reinforcement learning on the traffic core: Gymnasium's, one scenario or many, and gymnax's.

Importing this folder registers `rearl_jax/Highway-v0` with Gymnasium.
"""

from rearl_jax.environments.registration import make_env, register

__all__ = ["make_env"]

register()
