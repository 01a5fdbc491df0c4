"""The observer: prediction errors of a driver model on measured drives, their derivatives, and the fit that minimises
them.

Begin with `observer` (prediction and correction), `kalman` (gain), `fit_state` (parameters and likelihood of a fit),
`candidates` (effects that may be added) and `solver` (the objective).
"""
