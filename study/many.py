exec(open('/work/try/cmp3.py').read().split("names=[a")[0])
from hapticclay.heart import compiled, many, scene, path, rows
from hapticclay.stepping import monitor
N=int(sys.argv[1]) if len(sys.argv)>1 else 2000
rng=np.random.default_rng(1)
jobs=[hc.constant_cut(t_max=.036,b=float(b),gain=(float(g),.2), force=(float(f),0.)) for b,g,f in zip(rng.uniform(70,120,N),rng.uniform(.05,.4,N),rng.uniform(.5,2,N))]
K=compiled.KERNEL; store=nrun.EngineStore(K); r=nrun.Run(jobs[0],1,K,store)
t=time.perf_counter(); P=[scene.parts_of(j) for j in jobs]; print('parts us each', (time.perf_counter()-t)/N*1e6)
t=time.perf_counter(); numbers=np.array([many.numbers_of(p) for p in P]); print('numbers us each', (time.perf_counter()-t)/N*1e6, numbers.shape)
tables=np.array([p.table for p in P]); starts=np.array([(*j.start,*j.velocity) for j in jobs],float)
def runs_of():
    n=N
    crossed=np.full((n,8,3),np.nan); crossed[:,:,0]=-1
    return many.Runs(numbers,tables,starts,r.model.actuator_ctrlrange,compiled.RESET,store.rows,store.crossings,store.rendered,np.zeros(n,np.int64),np.zeros((n,16)),np.zeros((n,2)),crossed,np.zeros((n,4),np.int64),np.zeros(n),np.tile(np.array([0,-1,-1,0]),(n,1)),np.zeros((n,9)),np.zeros((2,monitor.QUIET)))
blocks=scene.blocks(r.parts,jobs[0])
t=time.process_time(); compiled.CARRY(r.parts,blocks,r.native,runs_of()); print('first', time.process_time()-t)
import mujoco
for _ in range(5):
    R=runs_of(); t=time.perf_counter(); compiled.CARRY(r.parts,blocks,r.native,R); dt1=time.perf_counter()-t
    steps=R.counts[:,1].sum()
    mujoco.mj_resetData(r.model,r.data); r.data.qvel[:]=.1; t=time.perf_counter(); mujoco.mj_step(r.model,r.data,int(steps)); fl=time.perf_counter()-t
    print('x mj_step', round(dt1/fl,3), 'steps', steps, 'floor us', fl/steps*1e6, 'good', R.good.sum())
for k in (0,5,77):
    a,w=nrun.completed(jobs[k],1,nrun.PLAIN,nrun.EngineStore(nrun.PLAIN)); A=a.kept[-1][1][-1]
    print(np.array_equal(A,R.last[k]), a.steps==R.counts[k,1], a.state.work.clay==R.work[k,2], str(a.outcome))
