"""The gallery: the scenes as pages of static HTML, to be read without a server or a network.

A page a scene, an index by the chapter's sections, and the story of least and stationary. What a
page shows is computed when the page is made.
"""

from actionopt.gallery.builder import build

__all__ = ["build"]
