import sys,time,statistics
names=sys.argv[1:]; sys.argv=sys.argv[:1]
exec(open('/work/try/cmp3.py').read().split("names=[a")[0])
from hapticclay.heart import compiled, path, scene
import mujoco
for n in names:
    s=S[n]; K=compiled.KERNEL; store=nrun.EngineStore(K)
    t=time.process_time(); r=nrun.Run(s,1,K,store); r.advance(10); t1=time.process_time()-t
    rc,rp,fl=[],[],[]
    def whole(r,adv):
        st=path.careful(r.views,r.state,r.e); 
        for _ in range(3):
            if path.may_glide(r.views,st): break
            st=path.careful(r.views,st,r.e)
        return adv(st)
    for _ in range(9):
        r=nrun.Run(s,1,K,store)
        def f(st):
            global t; t=time.perf_counter(); st=compiled.GLIDE(r.parts,st,r.native,4000); k=st.filled.rows; rc.append((time.perf_counter()-t)/k); return k
        k=whole(r,f)
        r=nrun.Run(s,1,K,store)
        def f(st):
            global t; t=time.perf_counter(); st=path.glide(r.views,st,r.e,400); rp.append((time.perf_counter()-t)/st.filled.rows)
        whole(r,f)
        model,data=r.model,r.data
        mujoco.mj_resetData(model,data); model.opt.timestep=s.dt; data.qvel[:]=.1; t=time.perf_counter(); mujoco.mj_step(model,data,k); fl.append((time.perf_counter()-t)/k)
    m=statistics.median
    print(n,f"glide first {t1:.2f} s cpu; compiled {m(a/b for a,b in zip(rc,fl)):.2f} ({min(rc)/min(fl):.2f}), python {m(a/b for a,b in zip(rp,fl)):.1f} ({min(rp)/min(fl):.1f}), floor {min(fl)*1e6:.2f} us, rows {k}",flush=True)
