from .records cimport Model, State, Summary
from . cimport begin
from . cimport energy
from . cimport path
from . cimport rows
from . cimport watch

cdef long CROSSINGS

cdef void finish(Model m, State s, Summary out, double px, double py, double vx, double vy, long room) noexcept nogil
cdef void store(Model m, State s, Summary out, long i) noexcept nogil
cdef void note(Model m, State s, Summary out) noexcept nogil
cdef void look(Model m, State s, Summary out) noexcept nogil
