"""The engine's dynamics, by the pieces of its step that an arm needs.

Neither contact, constraint, sensor nor equality acts on the arm, so none is looked for; and mj_step
reads a clock some twenty times. Without, the same bits take two thirds of the time.
"""


def put_inertia(e):
    """The engine's inertia where its joints are."""
    e.kinematics(e.model, e.data)
    e.com_pos(e.model, e.data)
    e.inertia(e.model, e.data)


def step(e):
    """What mj_step does for such an arm."""
    put_inertia(e)
    e.factor(e.model, e.data)
    e.transmission(e.model, e.data)
    e.at_velocity(e.model, e.data)
    e.actuation(e.model, e.data)
    e.acceleration(e.model, e.data)
    e.integrate(e.model, e.data)
