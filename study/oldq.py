import sys,time,statistics
names=sys.argv[1:]; sys.argv=sys.argv[:1]
exec(open('/work/try/cmp3.py').read().split("names=[a")[0])
import dataclasses, mujoco
from hapticclay.heart import compiled
from hapticclay.stepping.engine import build
for n in names:
    s=dataclasses.replace(S[n],t_max=1.5); hc.simulate(s,engine='native'); K=compiled.KERNEL; store=nrun.EngineStore(K)
    nrun.completed(s,1,K,store)
    model=build(s); data=mujoco.MjData(model)
    o,w,f=[],[],[]
    for _ in range(9):
        t=time.perf_counter(); r=hc.simulate(s,engine='native'); o.append((time.perf_counter()-t)/r.steps)
        t=time.perf_counter(); r,_t=nrun.completed(s,1,K,store); w.append((time.perf_counter()-t)/r.steps)
        mujoco.mj_resetData(model,data); model.opt.timestep=s.dt; data.qvel[:]=.1; t=time.perf_counter(); mujoco.mj_step(model,data,r.steps); f.append((time.perf_counter()-t)/r.steps)
    m=statistics.median
    print(n,f"old {m(a/b for a,b in zip(o,f)):.2f} new {m(a/b for a,b in zip(w,f)):.2f} new/old {m(a/b for a,b in zip(w,o)):.2f} (min {min(w)/min(o):.2f}) floor {min(f)*1e6:.2f}",flush=True)
