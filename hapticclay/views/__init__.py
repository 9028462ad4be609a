"""Figures, films, the window and the page; figures are imported when drawn."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=[
        "accuracy_plots",
        "identification_plots",
        "path_plots",
        "run_plots",
        "stability_map_plots",
        "sweep_plots",
        "theory_plots",
        "workspace_plots",
    ],
)
