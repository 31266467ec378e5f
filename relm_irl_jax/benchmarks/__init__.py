"""Benchmarks: `relm-irl bench NAME`."""
