"""Pages that compute: a law as JavaScript, and a trial path under the reader's hand."""

from actionopt.plot.live.page import page

__all__ = ["page"]
