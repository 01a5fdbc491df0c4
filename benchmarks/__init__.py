"""Speed and memory of rearl_jax, measured in turn with other programs that simulate highway traffic."""
