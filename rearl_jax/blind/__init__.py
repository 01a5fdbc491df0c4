"""The blind study of discovery: traffic from independent sources, sealed truths, scores."""
