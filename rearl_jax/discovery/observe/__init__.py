"""The observer: prediction errors (innovations) of a driver model on measured drives, their derivatives, and the fit
that minimises the errors. A piece is an uninterrupted part of one vehicle's track.

Begin with `observer` (prediction and correction), `kalman` (gain), `fit_state` (parameters and likelihood of a fit),
`candidates` (effects that may be added) and `solver` (the objective).
"""
