"""The report of a run: tables, figures, maps."""
