"""Code of the documents, run in this process: a new one takes seconds to import what they need."""

import contextlib
import io

import matplotlib
import matplotlib.pyplot as plt


def printed_by(code, folder):
    """What a snippet prints, run in a folder with a namespace of its own and empty figures.

    Args:
        code: the snippet.
        folder: that it runs in.
    """
    out = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), matplotlib.rc_context():
        try:
            exec(compile(code, "<snippet>", "exec"), {"__name__": "__main__"})
        finally:
            plt.close("all")
    return out.getvalue()
