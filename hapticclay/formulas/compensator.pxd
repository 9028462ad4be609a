cimport cython

cdef long ORDER, FORM, KICK, FEED, WORK, TERM, SUM, NEXT, TERMS

@cython.locals(size=cython.double, halvings=cython.long, row=cython.double)
cdef void exponential(double *form, long n, long i, double h, double *e, long at) noexcept nogil
cdef void double_time(long n, double *e, long at) noexcept nogil
@cython.locals(uneven=cython.bint)
cdef void form_kick(double *form, long n, long i, double before, double after, double *e, double *out) noexcept nogil
