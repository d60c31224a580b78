"""The lessons, in order; each stands in the module of its subject."""

from actionopt.gallery.course.lessons.forces import PUSH, SYMMETRY
from actionopt.gallery.course.lessons.index import LEAST_OR_NOT, PHASE, STRING
from actionopt.gallery.course.lessons.lagrangians import GAUGE, SLOPES, T_MINUS_V
from actionopt.gallery.course.lessons.paths import FIRST_ORDER, HUNT, LOCAL
from actionopt.gallery.course.lessons.quantum import SLITS, SUM
from actionopt.gallery.course.lessons.rays import LIGHT, STONES

LESSONS = (
    *(HUNT, FIRST_ORDER, LOCAL, T_MINUS_V, GAUGE),
    *(LIGHT, STONES, LEAST_OR_NOT, STRING, PUSH),
    *(SYMMETRY, SLOPES, PHASE, SUM, SLITS),
)
BY_NAME = {lesson.name: lesson for lesson in LESSONS}
