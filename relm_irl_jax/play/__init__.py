"""Animations of agents, and navigation by keyboard."""
