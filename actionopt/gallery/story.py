"""The page that tells when a stationary action is a least one."""

from __future__ import annotations

from actionopt.gallery.page import Page, frame


def story() -> Page:
    """Return the page."""
    main = "<h1>Is it really least?</h1>"
    return Page({"least.html": frame("Is it really least?", main, root="", description="")})
