"""Soft actor-critic (SAC) of an environment of hapticclay, in one file.

    python examples/learning/sac.py --env AdaptiveGain-v0 --steps 200000 --seed 1

Needs torch beside hapticclay[gym]. It writes what `ppo.py` writes, whose scales and files
it shares. After Haarnoja et al. 2018 (two critics, a temperature that holds the entropy of the
policy at -1 per action). An action is held for REPEAT control periods. In AdaptiveGain the policy
names the gain that it wants, and the environment's action moves the gain there: a random action is
then a random gain, not a random walk.
"""

from __future__ import annotations

import argparse
import copy
import math
import time

import gymnasium
import numpy as np
import torch
from ppo import Scale, options, save
from torch import nn

import hapticclay.gym  # noqa: F401, registers the environments

COPIES, REPEAT, UPDATES, BATCH, KEPT = 64, 4, 16, 256, 200_000
RATE, GAMMA, SLOW, RANDOM = 5e-4, 0.97, 0.01, 5_000
LOW, HIGH = math.log10(0.5), math.log10(30.0)  # of the gain that AdaptiveGain's policy may want


def wanted_gain(u: np.ndarray, raw: np.ndarray) -> np.ndarray:
    """Action of AdaptiveGain that moves the gain to the one wanted, at most 2^(1/4) a period."""
    to = LOW + 0.5 * (u + 1.0) * (HIGH - LOW)
    return np.clip((to - raw[:, -2:-1]) / (0.25 * math.log10(2.0)), -1.0, 1.0)


class Held:
    """Copies of an environment whose action is held for some control periods.

    The rest of the periods after an end belongs to the next episode, and counts nowhere.
    """

    def __init__(self, a: argparse.Namespace):
        self.envs = gymnasium.make_vec(
            f"hapticclay/{a.env}", num_envs=COPIES, autoreset_mode="SAME_STEP", engine=a.engine
        )
        self.act = wanted_gain if a.env == "AdaptiveGain-v0" else lambda u, raw: u
        self.raw, _ = self.envs.reset(seed=1_000_000 * a.seed)

    def step(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rewards, last observations of the action, and whether episodes ended or were cut off."""
        total, ended, cut_off = np.zeros(COPIES), np.zeros(COPIES, bool), np.zeros(COPIES, bool)
        after = np.zeros_like(self.raw)
        for _ in range(REPEAT):
            live = ~(ended | cut_off)
            action = self.act(u, self.raw).astype(np.float32)
            self.raw, reward, done, late, info = self.envs.step(action)
            total += np.where(live, reward, 0.0)
            after[live] = self.raw[live]
            for i in np.flatnonzero(live & (done | late)):
                after[i] = info["final_obs"][i]
            ended, cut_off = ended | (live & done), cut_off | (live & late & ~done)
        return total, after, ended, cut_off


class Memory:
    """The last transitions, as a ring."""

    def __init__(self, n: int, k: int):
        self.rows = np.zeros((KEPT, 2 * n + k + 2), np.float32)
        self.at = np.cumsum((n, k, 1, n))
        self.next = self.count = 0

    def add(self, *parts: np.ndarray) -> None:
        rows = np.column_stack(parts)
        self.rows[(self.next + np.arange(len(rows))) % KEPT] = rows
        self.next = (self.next + len(rows)) % KEPT
        self.count = min(self.count + len(rows), KEPT)

    def some(self) -> list[np.ndarray]:
        rows = self.rows[np.random.randint(0, self.count, BATCH)]
        return np.split(rows, self.at, axis=1)


def layers(n: int, k: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(n, 128), nn.ReLU(), nn.Linear(128, 128), nn.ReLU(), nn.Linear(128, k)
    )


class Agent(nn.Module):
    def __init__(self, n: int, k: int):
        super().__init__()
        self.policy, self.critics = (
            layers(n, 2 * k),
            nn.ModuleList([layers(n + k, 1) for _ in "ab"]),
        )
        self.slow = copy.deepcopy(self.critics).requires_grad_(False)
        self.heat = nn.Parameter(torch.tensor(-2.0))  # logarithm of the temperature

    def sample(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Actions, and the logarithms of their densities."""
        mean, spread = self.policy(x).chunk(2, 1)
        law = torch.distributions.Normal(mean, spread.clamp(-5.0, 1.0).exp())
        y = law.rsample()
        u = y.tanh()
        return u, (law.log_prob(y) - torch.log(1.0 - u * u + 1e-6)).sum(1)

    def best(self, x: torch.Tensor) -> torch.Tensor:
        return self.policy(x).chunk(2, 1)[0].tanh()

    @staticmethod
    def least(critics: nn.ModuleList, x: torch.Tensor, u: torch.Tensor) -> torch.Tensor:
        both = torch.cat((x, u), 1)
        return torch.min(critics[0](both), critics[1](both))[:, 0]


def learn(agent: Agent, optimisers: list, memory: Memory, scale: Scale) -> None:
    x, u, r, y, on = memory.some()
    x, y, u = scale(x), scale(y), torch.as_tensor(u)
    r, on = torch.as_tensor(r[:, 0]), torch.as_tensor(on[:, 0])
    heat = agent.heat.exp().detach()
    with torch.no_grad():
        v, logp = agent.sample(y)
        target = r + GAMMA * on * (agent.least(agent.slow, y, v) - heat * logp)
    both = torch.cat((x, u), 1)
    losses = [nn.functional.mse_loss(q(both)[:, 0], target) for q in agent.critics]
    step(optimisers[0], losses[0] + losses[1])
    v, logp = agent.sample(x)
    step(optimisers[1], (heat * logp - agent.least(agent.critics, x, v)).mean())
    step(optimisers[2], -agent.heat * (logp.detach().mean() - u.shape[1]))
    with torch.no_grad():
        for slow, fast in zip(agent.slow.parameters(), agent.critics.parameters(), strict=True):
            slow.lerp_(fast, SLOW)


def step(optimiser: torch.optim.Optimizer, loss: torch.Tensor) -> None:
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()


def train(a: argparse.Namespace) -> None:
    torch.manual_seed(a.seed)
    torch.set_num_threads(1)
    np.random.seed(a.seed)
    env = Held(a)
    n, k = env.raw.shape[1], env.envs.single_action_space.shape[0]
    agent, scale, memory = Agent(n, k), Scale(n), Memory(n, k)
    parts = agent.critics.parameters(), agent.policy.parameters(), [agent.heat]
    optimisers = [torch.optim.Adam(x, lr=RATE) for x in parts]
    totals, finished, rows, begin = np.zeros(COPIES), [], [], time.process_time()
    worst = -REPEAT / (1.0 - GAMMA)  # an end costs no more than the largest cost for ever
    count = a.steps // (COPIES * REPEAT)
    for i in range(count):
        raw = env.raw
        scale.add(raw)
        with torch.no_grad():
            u = agent.sample(scale(raw))[0].numpy()
        if i * COPIES < RANDOM:
            u = np.random.uniform(-1.0, 1.0, u.shape)
        reward, after, ended, cut_off = env.step(u)
        memory.add(raw, u, np.maximum(reward, worst), after, 1.0 - ended)
        totals += reward
        over = ended | cut_off
        finished += totals[over].tolist()
        totals[over] = 0.0
        for group in (g for o in optimisers for g in o.param_groups):
            group["lr"] = RATE * min(1.0, 2.0 * (1.0 - i / count))
        for _ in range(UPDATES if i * COPIES >= RANDOM else 0):
            learn(agent, optimisers, memory, scale)
        steps, spent = (i + 1) * COPIES * REPEAT, time.process_time() - begin
        recent = float(np.mean(finished[-64:])) if finished else float("nan")
        if i % 10 == 9 or i == count - 1:
            rows.append((steps, recent, spent))
        if i % 100 == 99 or i == count - 1:
            print(
                f"{steps} steps, return {recent:.2f}, {spent:.0f} s of processor time", flush=True
            )
    env.envs.close()

    def policy(raw: np.ndarray) -> np.ndarray:
        """Decides in every control period: a new decision is no worse than a held one."""
        with torch.no_grad():
            return env.act(agent.best(scale(raw)).numpy(), raw)

    save(a, "sac", policy, agent.state_dict() | scale.tensors(), rows)


if __name__ == "__main__":
    train(options(__doc__))
