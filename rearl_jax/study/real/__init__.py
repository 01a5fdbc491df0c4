"""Discovery in measured recordings: verdicts, errors under every calibration protocol, comparison with known facts."""
