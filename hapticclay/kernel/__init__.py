"""How a row advances: records of a scene, of a run and of a kick, and the functions between them.

Each function is called with records: `m` is the Model of a scene, `s` the State of a run, `k` or
`e` a Kick, `x` and `y` its axes. CPython runs these sources on classes with slots; Cython compiles
them with the types that stand in the .pxd files beside them (the package `native`). Both give the
same bits. A kick changes nothing but its own record; `path.take` alone changes the state.
"""
