"""The results of the paper, one command each: ours through the other tasks, beside what the paper prints."""
