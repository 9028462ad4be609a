"""A quadratic drag that grows while the tool moves: f = c m |v| v, m' = (|v|/v0 - m)/tau."""
from math import sqrt, exp
from typing import NamedTuple
from hapticclay.heart.state import Load
class Part(NamedTuple):
    c: float
    v0: float
    tau: float
class State(NamedTuple):
    m: float
ON=[None]
def part(scenario): return ON[0]
def start(part, p): return State(0.0)
def refuses(scenario): return ""
def speed(v): return sqrt(v[0]*v[0]+v[1]*v[1])
def load(part, state, load, step, at):
    b = part.c*state.m*speed(at.v)
    f,d=load.f,load.d
    x,y=0.5*b*at.v[0],0.5*b*at.v[1]
    return Load((f[0]-step.L*b*at.v[0],f[1]-step.L*b*at.v[1]),(d[0]+step.R*b,d[1]+step.R*b,d[2]))
def moved(part, state, at, h):
    e=exp(-h/part.tau)
    return State(e*state.m+(1.0-e)*speed(at.v)/part.v0)
def force(part, state, p, v):
    b=part.c*state.m*speed(v)
    return b*v[0],b*v[1]
