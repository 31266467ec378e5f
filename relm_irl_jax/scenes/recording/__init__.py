"""Recording of other simulators' scenes as scene files."""
