cdef double B_MAX
