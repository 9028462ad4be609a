"""Figures of commands, without what takes longest of them."""

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def no_layout(monkeypatch):
    """Figures are written as they are."""
    monkeypatch.setattr(Figure, "get_layout_engine", lambda self: None)
