"""The mapping agent: it draws a map of an unseen room while it searches for the target.

This agent is in development and is not yet offered by the command line.
"""
