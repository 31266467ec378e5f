"""What a run shows: tables, figures, maps."""
