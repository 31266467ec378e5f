"""An agent whose critic is a distance between views, learned in hindsight from the graph of its own experience."""
