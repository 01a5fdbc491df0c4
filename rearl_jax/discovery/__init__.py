"""Discovery: calibrates the driver model, tests its residuals, names missing effects and repairs the model.

In the order of the data: `read` (recordings to measured drivers), `comparison` (choice of the car-following model),
`observe` (calibration, with prediction errors by a Kalman filter), `search` (score tests and fits of candidate
effects), `lane_changes` (lane choice), `report` (verdict, tables and figures). `groups` divides the drivers first.

Drivers are divided into three parts without common drivers: models are fitted to the fitted drivers, candidates are
checked on the check drivers, and errors are stated for the report drivers, who are used neither in the fit nor in the
choice of effects. `before` is the calibrated model, `after` the final model with the effects found.
"""
