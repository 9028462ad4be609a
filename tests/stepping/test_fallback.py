"""Where the installed numba is another one than the code expects, Python makes the runs."""

import importlib.util
import json
import os
import subprocess
import sys

import pytest

fast = pytest.mark.skipif(
    importlib.util.find_spec("numba") is None, reason="needs numba: pip install hapticclay[fast]"
)

# each of these is used at another stage: import, typing, code, linking, storing, calling
GONE = (
    "numba:njit",
    "numba.extending:intrinsic",
    "numba.core.types:UniTuple",
    "numba.core.cgutils:raw_memcpy",
    "numba.core.base:BaseContext.make_tuple",
    "numba.core.base:BaseContext.get_return_value",
    "numba.core.codegen:CPUCodegen.magic_tuple",
    "numba.core.compiler:CompileResult._reduce",
    "numba.core.dispatcher:_DispatcherBase.typeof_pyval",
    "llvmlite.binding:Linkage",
)

# one process that loads numba, and a fork of it for each name that is gone
PROGRAM = """
import importlib, json, os, sys, tempfile
import hapticclay as hc
import numba, numba.core.caching, numba.extending, llvmlite.binding, mujoco

def without(name, folder):
    os.environ["NUMBA_CACHE_DIR"] = folder  # empty: nothing was compiled before
    module, _, path = name.partition(":")
    owner, last = importlib.import_module(module), path
    while "." in last:
        head, _, last = last.partition(".")
        owner = getattr(owner, head)
    delattr(owner, last)

def runs(engine):
    s = hc.constant_cut(t_max=0.02)
    r = [hc.simulate(s, engine=engine) for _ in range(2)]
    one = hc.Simulation(s, engine=engine)
    for _ in range(3):
        one.step()
    return [x.p[-1].tolist() for x in r] + [list(one.state.p)]

expected = runs("python")
for name in json.loads(sys.argv[1]):
    sys.stdout.flush()
    with tempfile.TemporaryDirectory() as folder:
        pid = os.fork()
        if pid == 0:
            print("#", name, file=sys.stderr, flush=True)
            without(name, folder)
            print(json.dumps([name, runs("native") == expected]), flush=True)
            os._exit(0)
        os.waitpid(pid, 0)
"""


@fast
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_whatever_numba_lacks_python_makes_the_runs_and_one_line_says_so():
    out = subprocess.run(
        [sys.executable, "-c", PROGRAM, json.dumps(GONE)], capture_output=True, text=True
    )
    assert [json.loads(x) for x in out.stdout.splitlines()] == [[x, True] for x in GONE], out.stderr
    said = [x.splitlines() for x in out.stderr.split("# ")[1:]]
    for name, *lines in said:
        told = [x for x in lines if x.startswith("hapticclay: Python runs what native cannot: ")]
        assert len(told) == 1 and len(told[0]) < 300, (name, lines)
        assert "Traceback" not in lines, (name, lines)


@fast
def test_a_compiler_that_fails_later_in_a_process_is_noticed_too():
    """What is loaded still runs; what is compiled next raises, in a run and step by step."""
    code = (
        "import dataclasses, hapticclay as hc, numba\n"
        "s = hc.free(t_max=0.01)\n"
        "first = hc.simulate(s, engine='native')\n"
        "def gone(*a, **k): raise RuntimeError('two\\nlines')\n"
        "numba.core.compiler.Compiler.compile_extra = gone\n"
        "wires = hc.Hardware(dropout_probability=0.1, encoder=4096, friction=(0.1, 0))\n"
        "wave = hc.Multisine(rms=(1e-3, 1e-3), low=1.0, high=3.0, period=1.0, seed=1)\n"
        "other = dataclasses.replace(  # of a kind that nobody compiles\n"
        "    s, operator=hc.Operator(), hardware=wires, command=wave, control='sampled',\n"
        "    compensator=hc.Compensator((1.0, 20.0), (1.0, 40.0, 400.0)))\n"
        "a, b = hc.simulate(other, engine='native'), hc.simulate(other, engine='python')\n"
        "one = hc.Simulation(other, engine='native')\n"
        "assert (a.p == b.p).all() and (a.tau == b.tau).all()\n"
        "for p in b.p[1:4]:\n"
        "    one.step()\n"
        "    assert (one.state.p == p).all()\n"
        "assert (hc.simulate(s, engine='native').p == first.p).all()\n"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert out.returncode == 0, out.stderr
    told = [x for x in out.stderr.splitlines() if "Python runs what native cannot" in x]
    assert len(told) == 1 and told[0].endswith("two"), out.stderr
