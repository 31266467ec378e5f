"""The stages of a run: each reads the configuration and earlier results, and writes its results to the run folder."""
