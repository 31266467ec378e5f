"""Watching agents, and walking to targets by keyboard."""
