"""Discovery: calibrates the driver model, tests its residuals, names missing effects and repairs the model."""
