"""Training of the small encoder on labelled scenes."""
