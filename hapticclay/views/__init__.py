"""Plots, windows, pages and films."""
