"""Episodes in the files of other libraries: Minari's datasets, and the `imitation` library's trajectories."""
