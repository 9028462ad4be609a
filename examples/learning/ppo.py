"""Proximal policy optimisation (PPO) of an environment of hapticclay, in one file.

    python examples/learning/ppo.py --env CutLine-v0 --steps 300000 --seed 1

Needs torch and hapticclay[gym]. It writes the learning curve (CSV), the policy (its weights)
and, with --film, a film of an episode. After Schulman et al. 2017, with the details of
Huang et al. 2022, "The 37 implementation details of PPO": one network each for policy and value,
observations and rewards normalised, advantages by GAE, the value of the last observation where an
episode was cut off.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path

import gymnasium
import numpy as np
import torch
from torch import nn

import hapticclay.gym  # noqa: F401, registers the environments

COPIES, HORIZON, EPOCHS, PARTS = 64, 32, 8, 8
RATE, GAMMA, LAMBDA, CLIP = 1e-3, 0.99, 0.95, 0.2


class Scale:
    """Mean and variance of what has been seen."""

    def __init__(self, n: int):
        self.mean, self.var, self.count = np.zeros(n), np.ones(n), 1e-4

    def add(self, x: np.ndarray) -> None:
        n, d = len(x), x.mean(axis=0) - self.mean
        whole = self.count + n
        self.mean = self.mean + d * n / whole
        m = self.var * self.count + x.var(axis=0) * n + d * d * self.count * n / whole
        self.var, self.count = m / whole, whole

    def __call__(self, x: np.ndarray) -> torch.Tensor:
        y = (x - self.mean) / np.sqrt(self.var + 1e-8)
        return torch.as_tensor(np.clip(y, -10, 10), dtype=torch.float32)

    def tensors(self) -> dict[str, torch.Tensor]:
        return {"mean": torch.as_tensor(self.mean), "var": torch.as_tensor(self.var)}


def layers(n: int, k: int, last: float) -> nn.Sequential:
    made = nn.Sequential(
        nn.Linear(n, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, k)
    )
    for i, gain in ((0, 2**0.5), (2, 2**0.5), (4, last)):
        nn.init.orthogonal_(made[i].weight, gain)
        nn.init.zeros_(made[i].bias)
    return made


class Agent(nn.Module):
    def __init__(self, n: int, k: int):
        super().__init__()
        self.policy, self.value = layers(n, k, 0.01), layers(n, 1, 1.0)
        self.spread = nn.Parameter(torch.full((k,), -1.6))

    def law(self, x: torch.Tensor) -> torch.distributions.Normal:
        return torch.distributions.Normal(self.policy(x), self.spread.exp())


def train(a: argparse.Namespace) -> None:
    torch.manual_seed(a.seed)
    torch.set_num_threads(1)
    env = gymnasium.make_vec(
        f"hapticclay/{a.env}", num_envs=COPIES, autoreset_mode="SAME_STEP", engine=a.engine
    )
    n, k = env.single_observation_space.shape[0], env.single_action_space.shape[0]
    agent, scale, size = Agent(n, k), Scale(n), Scale(1)
    optimiser = torch.optim.Adam(agent.parameters(), lr=RATE, eps=1e-5)
    raw, _ = env.reset(seed=1_000_000 * a.seed)
    discounted, totals, finished, rows = np.zeros(COPIES), np.zeros(COPIES), [], []
    updates, begin = a.steps // (COPIES * HORIZON), time.process_time()
    for update in range(updates):
        for group in optimiser.param_groups:
            group["lr"] = RATE * (1.0 - update / updates)
        store = {name: [] for name in ("x", "u", "logp", "value", "r", "over")}
        for _ in range(HORIZON):
            scale.add(raw)
            x = scale(raw)
            with torch.no_grad():
                law, value = agent.law(x), agent.value(x)[:, 0].numpy()
                u = law.sample()
                logp = law.log_prob(u).sum(1)
            raw, reward, ended, cut_off, info = env.step(u.clamp(-1, 1).numpy())
            totals += reward
            over = ended | cut_off
            discounted = GAMMA * discounted * ~over + reward
            size.add(discounted[:, None])
            r = np.clip(reward / np.sqrt(size.var[0] + 1e-8), -10, 10)
            if cut_off.any():  # not an end: what comes is worth the value of the last observation
                last = np.stack([info["final_obs"][i] for i in np.flatnonzero(cut_off)])
                with torch.no_grad():
                    more = agent.value(scale(last))[:, 0].numpy()
                r[cut_off] += GAMMA * more * ~ended[cut_off]
            for name, y in zip(store, (x, u, logp, value, r, over), strict=True):
                store[name].append(y)
            finished += totals[over].tolist()
            totals[over] = 0.0
        learn(agent, optimiser, store, scale(raw))
        recent = float(np.mean(finished[-200:])) if finished else float("nan")
        steps, spent = (update + 1) * COPIES * HORIZON, time.process_time() - begin
        rows.append((steps, recent, spent))
        if update % 20 == 19 or update == updates - 1:
            told = f"{spent:.0f} s of processor time"
            print(f"{steps} steps, return {recent:.2f}, {told}", flush=True)
    env.close()

    def policy(raw: np.ndarray) -> np.ndarray:
        with torch.no_grad():
            return agent.policy(scale(raw)).clamp(-1, 1).numpy()

    save(a, "ppo", policy, agent.state_dict() | scale.tensors(), rows)


def learn(agent: Agent, optimiser, store: dict, after: torch.Tensor) -> None:
    with torch.no_grad():
        following = agent.value(after)[:, 0].numpy()
    gains, carried = [], np.zeros(COPIES)
    for t in reversed(range(HORIZON)):
        on = ~store["over"][t]
        d = store["r"][t] + GAMMA * following * on - store["value"][t]
        carried = d + GAMMA * LAMBDA * on * carried
        gains.insert(0, carried)
        following = store["value"][t]
    gains, values = np.concatenate(gains), np.concatenate(store["value"])
    target = torch.as_tensor(gains + values, dtype=torch.float32)
    gains = torch.as_tensor(gains, dtype=torch.float32)
    x, u, before = (torch.cat(store[name]) for name in ("x", "u", "logp"))
    for _ in range(EPOCHS):
        for part in torch.randperm(len(x)).chunk(PARTS):
            law = agent.law(x[part])
            ratio = (law.log_prob(u[part]).sum(1) - before[part]).exp()
            g = (gains[part] - gains[part].mean()) / (gains[part].std() + 1e-8)
            policy = -torch.min(ratio * g, ratio.clamp(1 - CLIP, 1 + CLIP) * g).mean()
            value = ((agent.value(x[part])[:, 0] - target[part]) ** 2).mean()
            optimiser.zero_grad()
            (policy + 0.5 * value).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), 0.5)
            optimiser.step()


def save(a: argparse.Namespace, name: str, policy, weights: dict, rows: list) -> None:
    a.out.mkdir(parents=True, exist_ok=True)
    stem = a.out / f"{name}-{a.env}-{a.seed}"
    with stem.with_suffix(".csv").open("w", newline="") as file:
        csv.writer(file).writerows([("steps", "return", "processor seconds"), *rows])
    torch.save(weights, stem.with_suffix(".pt"))
    from hapticclay.gym import baselines

    found = baselines.returns(a.env, lambda *_: policy, range(100), engine=a.engine)
    mean, half = baselines.mean_of(found.total)
    print(f"{a.env} seed {a.seed}: return {mean:.2f} +- {half:.2f} over seeds 0 to 99")
    if a.film:
        film(a, policy, stem.with_suffix(".gif"))


def film(a: argparse.Namespace, policy, path: Path) -> None:
    import imageio

    env = gymnasium.make(f"hapticclay/{a.env}", render_mode="rgb_array", engine=a.engine)
    raw, _ = env.reset(seed=0)
    frames, over, t = [env.render()], False, 0
    while not over:
        raw, _, ended, cut_off, _ = env.step(policy(raw[None])[0])
        over, t = ended or cut_off, t + 1
        if t % 4 == 0 or over:
            frames.append(env.render())
    imageio.mimsave(path, frames, duration=80, loop=0)
    env.close()


def options(what: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=what.splitlines()[0])
    parser.add_argument("--env", default="CutLine-v0")
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--engine", default="auto")
    parser.add_argument("--film", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out/learning"))
    return parser.parse_args()


if __name__ == "__main__":
    train(options(__doc__))
