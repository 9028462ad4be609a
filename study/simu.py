exec(open('/work/try/cmp3.py').read().split("names=[a")[0])
from hapticclay.heart.stepwise import Simulation
from hapticclay.heart import compiled
import pickle
sc=hc.constant_cut(t_max=2.0)
for K in (nrun.PLAIN, compiled.KERNEL):
    sim=Simulation(sc,K); sim.advance(10)
    t=time.perf_counter(); sim.advance(1000); dt=time.perf_counter()-t; print('steps/s', 1000/dt)
    t=time.perf_counter(); 
    for _ in range(300): sim.advance(1)
    dt=time.perf_counter()-t; print('single steps/s', 300/dt)
    t=time.perf_counter(); 
    for _ in range(100): sim.advance(10)
    dt=time.perf_counter()-t; print('by ten steps/s', 1000/dt)
    snap=sim.snapshot(); s0=sim.state; sim.advance(500); s1=sim.state; sim.restore(pickle.loads(pickle.dumps(snap))); assert all(np.array_equal(a,b) for a,b in zip(sim.state,s0)); sim.advance(500); assert all(np.array_equal(a,b) for a,b in zip(sim.state,s1)); print('snapshot ok')
    for _ in range(3):
        t=time.perf_counter(); sim.reset(hc.constant_cut(t_max=2.0,b=80.)); print('reset ms', (time.perf_counter()-t)*1e3)
    sim.advance(100); sim.set(gain=(.3,.2)); sim.advance(100); print(sim.state.p, sim.diverging)
    t=time.perf_counter(); sim.diverging; sim._looked=-1; sim.diverging; print('diverging ms', (time.perf_counter()-t)*1e3)
    sim._store.__exit__(None,None,None)
