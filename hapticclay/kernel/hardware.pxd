from .records cimport Kick, Machine, Model, State
from ..formulas cimport cmath as math
from ..formulas cimport hardware as law
from . cimport arm

cdef long QUEUED, CHANCE

cdef double lateness(Model m, long long k) noexcept nogil
cdef bint is_lost(Model m, long long k) noexcept nogil
cdef double noise(Model m, long long k, long i) noexcept nogil
cdef double measured(Model m, State s, long i, double f) noexcept nogil
cdef double converted(Model m, double f) noexcept nogil
cdef double encoded(Model m, long i, double q) noexcept nogil
cdef void differenced(Model m, State s, double *q, double *w) noexcept nogil
cdef void note_angles(Model m, State s) noexcept nogil
cdef double given(Model m, long i, double tau) noexcept nogil
cdef void drive(Model m, State s, double *tau) noexcept nogil
cdef (double, double) couple(Model m, State s, Kick k, double bx, double by) noexcept nogil
cdef double guarded(Model m, State s, Kick k, long i, double f) noexcept nogil
cdef void note_force(Model m, State s) noexcept nogil
cdef void advance_queue(Model m, State s, double now) noexcept nogil
cdef void hold(Model m, Machine machine, double *of, long long j) noexcept nogil
cdef void note_request(Model m, State s) noexcept nogil
cdef double due_time(Model m, long long first, long long n, long i, long long waits, double time) noexcept nogil
cdef void enqueue(Model m, State s) noexcept nogil
