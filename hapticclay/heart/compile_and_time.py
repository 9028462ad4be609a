import sys, time, ctypes, statistics
from pathlib import Path
from types import FunctionType
import numpy as np, numba, mujoco
from numba.extending import overload
sys.argv, names = sys.argv[:1], sys.argv[1:]
exec(open('try1.py').read().split("names=")[0])
from hapticclay.model import arm, clay, compensator, controller, flow, groove, hardware, operator, pieces, regions, spring
from hapticclay.heart import engine_step, energy, fast, grooves, hand, kick, path, rows, servo, springs, state, viscous, yielding
LAW={"error_model":"numpy","no_cfunc_wrapper":True,"_nrt":False}
for m in (arm,clay,compensator,controller,flow,groove,hardware,operator,pieces,regions,spring,engine_step,energy,fast,grooves,hand,kick,path,rows,servo,springs,state,viscous,yielding):
    for f in vars(m).values():
        if isinstance(f,FunctionType) and f.__module__==m.__name__ and f is not path.advance:
            overload(f,jit_options=LAW,strict=False)(lambda *a,f=f:f)
adv=numba.njit(nogil=True,error_model="numpy",_nrt=False)(path.advance)
lib=ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("*mujoco.*"))))
lib.mj_step.argtypes,lib.mj_step.restype=[ctypes.c_size_t]*2,None
def eng(model,data,arrays): return scene.Engine(lib.mj_step,model._address,data._address,*arrays)
for n in names:
    s=S[n]
    t=time.process_time(); out=scene.run(s,adv,eng); t1=time.process_time()-t
    py=scene.run(s)
    same=np.array_equal(out[0],py[0]) and out[1]==py[1] and out[3].ledger==py[3].ledger
    rs=[]
    for _ in range(5):
        t=time.perf_counter(); o=scene.run(s,adv,eng); ours=(time.perf_counter()-t)/len(o[0])
        e,arrays,model,data=scene.make_engine(s)
        model.opt.timestep=s.dt; data.qvel[:]=.1; t=time.perf_counter(); mujoco.mj_step(model,data,len(o[0])); fl=(time.perf_counter()-t)/len(o[0])
        rs.append(ours/fl)
    print(n,f"first {t1:.2f} s cpu, same bits {same}, x mj_step {statistics.median(rs):.2f}, floor {fl*1e6:.2f} us", [round(x,2) for x in rs])
