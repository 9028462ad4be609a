cdef extern from "math.h" nogil:
    double cos(double)
    double sin(double)
    double acos(double)
    double atan2(double, double)
    double sqrt(double)
    double pow(double, double)
    double tanh(double)
    double exp(double)
    double expm1(double)
    double ceil(double)
    double floor(double)
    double copysign(double, double)
    double rint(double)
    double inf "INFINITY"
    double nan "NAN"
    double pi "3.14159265358979323846"
    double tau "(2.0 * 3.14159265358979323846)"
