"""The stages of a run, each a function of the configuration and the stages before it."""
