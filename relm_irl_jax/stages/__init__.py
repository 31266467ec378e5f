"""The stages of a run: each takes the configuration and earlier results, and leaves its own in the run folder."""
