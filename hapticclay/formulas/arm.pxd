from . cimport cmath as math

cdef (double, double, double, double) jacobian(double q1, double q2, double *links) noexcept nogil
cdef (double, double, double) mobility(double *u, double *links) noexcept nogil
cdef (double, double) handle_velocity(double r1, double r2, double *u) noexcept nogil
cdef (double, double) centripetal(double r1, double r2, double *u) noexcept nogil
cdef (double, double) centripetal_about_sample(double L, double cx, double cy, double vx, double vy, double *u) noexcept nogil
cdef (double, double) joint_torques(double fx, double fy, double *u) noexcept nogil
cdef (double, double) joint_velocity(double vx, double vy, double *u, double n) noexcept nogil
cdef (double, double) inverse_kinematics(double x, double y, double *links) noexcept nogil
