"""Published formats of recordings: what each file means, read into canonical tables."""
