exec(open('/work/try/cmp3.py').read().split("names=[a")[0])
S={}
S['pulse']=hc.Scenario(clay=hc.slab(90.,.05,.15),t_max=1.0, muscle=hc.Pulse((1.,.5),0,.2,.5))
S['multi']=hc.Scenario(clay=hc.slab(90.,.05,.15),t_max=1.0, muscle=hc.Multisine(rms=(.5,.3),low=.5,high=20.,period=2.))
S['command']=hc.Scenario(t_max=1.0, command=hc.Multisine(rms=(.005,.003),low=.5,high=5.,period=2.), clay=hc.slab(20.,.01,.02))
S['both']=hc.Scenario(t_max=1.0, muscle=hc.Pulse((1.,.5),0,.2003,.5)+hc.Multisine(rms=(.5,.3),low=.5,high=20.,period=2.), command=hc.Pulse((.01,.005),0,.2,.5), clay=hc.slab(20.,.01,.02))
exec("names=[a"+open('/work/try/cmp3.py').read().split("names=[a")[1])
