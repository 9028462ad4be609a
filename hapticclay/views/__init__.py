"""Figures, films, the window and the page; figures are loaded when they are drawn."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submodules=["run_plots", "study_plots", "theory_plots"]
)
