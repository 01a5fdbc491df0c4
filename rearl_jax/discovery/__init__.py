"""Discovery: calibrates the driver model to measured drives, tests its residuals, names missing effects, repairs the
model.
"""
