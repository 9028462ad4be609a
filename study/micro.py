import timeit,sys
exec(open('/work/try/cmp2.py').read().split("names=")[0])
from hapticclay.heart import path, kick, rows, servo, viscous, engine_step, state, borders
s=S['cut']; e,arrays,bounds,model,data=scene.make_engine(s); P=scene.parts_of(s); st=scene.start(P,s,e)
for _ in range(800): 
    st=path.careful(P,st,e); st=st._replace(filled=state.Filled(0,0,0,0))
dt=s.dt
def T(name,f,n=20000):
    t=min(timeit.repeat(f,number=n,repeat=5))/n*1e6; print(f'{name} {t:.2f}',end='; ')
k=kick.kick(P,st.clock,st.body,st.loop,st.clay,dt)
T('mj_step', lambda: mujoco.mj_step(model,data)) if False else None
import mujoco
T('mj_step', lambda: mujoco.mj_step(model,data))
T('kick', lambda: kick.kick(P,st.clock,st.body,st.loop,st.clay,dt))
T('step_around', lambda: kick.step_around(dt,dt))
T('handle_at', lambda: kick.handle_at(P.arm,st.body,dt/2))
T('muscle', lambda: kick.muscle_force(P.push,0.1,k.step))
T('damping', lambda: viscous.damping(P.clay,P.special,st.clay,.1,None,k.step))
ld=state.Load(k.uh,(0.,0.,0.))
T('with_clay', lambda: viscous.with_clay(P.clay,P.grain,ld,k.viscous,k.at.v))
T('servo_law', lambda: servo.servo_law(P,k.step,k.at,st.loop))
law=servo.servo_law(P,k.step,k.at,st.loop)[0]
T('moved', lambda: kick.moved(None,None,None,law,ld,None,k.step,k.at,k.viscous,k.uh))
T('advanced', lambda: servo.advanced(P.lag,P.form,k.step,st.loop,(0.,0.),(0.,0.)))
T('link_torques', lambda: kick.link_torques(P.arm.links,k.at.u,k.g,k.motion.f))
T('calm_end', lambda: kick.is_calm_end(P.arm,st.clay.region,st.body.q,k.w,dt))
T('kept', lambda: path.kept(P,st,e,k,dt,True))
T('write', lambda: rows.write(P,e.rows,0,st.body.q,k,k.at.v,(0.,0.)))
T('with_work', lambda: rows.with_work(P,st.work,k,st.body.w))
T('stepped', lambda: path.stepped(P,st,e,k,dt,0.1))
T('moved_arm', lambda: engine_step.moved_arm(P,e,dt,st.body.w,k,dt))
T('clay_behind', lambda: path.clay_behind(P,st.clay,k,st.body.q,st.body.w,dt))
T('may_glide', lambda: path.may_glide(P,st))
T('has_room', lambda: path.has_room(e,st.filled,100))
T('Axis', lambda: state.Axis(1.,2.,3.,4.))
T('State', lambda: state.State(1,2,3,4,5,6,7))
T('Kick', lambda: state.Kick(1,2,3,4,5,6,7,8,9,1,2,3))
T('nothing', lambda: None)
