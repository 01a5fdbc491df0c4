"""Closing the loop with measured data: calibrate, look at the residual, name the missing effect, repair the model."""
