"""Figures, films, the window and the page; each module is loaded when it is used."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["film", "page", "run_plots", "session", "stage", "study_plots", "style",
                "theory_plots", "viewer", "window"],
)  # fmt: skip
