"""Studies of several runs: the paper's tables on all tasks, and ablations."""
