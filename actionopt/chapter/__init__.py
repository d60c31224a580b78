"""The chapter on Lagrangian mechanics, run section by section.

*Competitive Physics: Mechanics and Waves* (World Scientific, 2018), chapter 12, pp. 623-649.
Every system of it is solved, and what the chapter says of it is compared with what comes out.

>>> row = next(row for row in ROWS if "sliding off" in row.system)
>>> all(line.agrees for line in row.check())
True
"""

from actionopt.chapter import _calculus, _conserved, _constraints, _coordinates, _ends
from actionopt.chapter._row import Line, Row

__all__ = ["ROWS", "Line", "Row"]

ROWS: tuple[Row, ...] = tuple(
    sorted(
        (
            item
            for module in (_calculus, _ends, _coordinates, _constraints, _conserved)
            for item in vars(module).values()
            if isinstance(item, Row)
        ),
        key=lambda row: row.section,
    )
)
"""The rows in order of sections."""
