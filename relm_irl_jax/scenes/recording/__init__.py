"""Recording of scenes of other simulators as scene files."""
