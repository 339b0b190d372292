#!/usr/bin/env python3
"""Steers to the ends of a tree's vessels by what xraycast.gym.ReachTarget observes: a policy that learning has to beat.

    steer.py TREE [SEEDS]

TREE is a tree.vtp, such as that of `xraycast phantom thorax --truth`. Each seed (100 by default) is an episode of 300 steps with a target of
its own; a line tells what became of it, and the last line how many were reached.

A Cobra with an angled wire in it. The Cobra goes ahead, the wire behind its curve, and is turned so that its tip looks to where the
way goes at a fork. Where the way has turned and the tip with it, the Cobra has found the branch, and the wire goes on alone, steered by
its own tip. Whoever gets farther from the target draws back and turns; after the Cobra the wire has a try, and after the wire the Cobra.
The constants were found by a search of half an hour, over the ends of the thorax phantom's true tree and of the one that `segment`
finds: from the right groin it gets to 10 of 12, but not into the hepatic and the splenic artery.
"""
import sys
from typing import Any

import gymnasium
import numpy as np
import xraycast as xc
from numpy.typing import NDArray
from xraycast.gym import ReachTarget

Array = NDArray[Any]
DEVICES = ["cobra-5f", "guidewire-035-angled"]
STEP_MS, MOST_PUSH_MM, MOST_TURN_DEG = 40, 8.0, 40.0  # 0.2 m/s at most
Action = tuple[float, float, float, float]  # push and turn of the Cobra, push and turn of the wire, -1 to 1

FORK_DEG = 24.0  # by which the way bends ahead
SELECTED_DEG = 45.0  # by which it has turned since then: the tip is in the branch
AIMED_DEG, SLOWLY = 60.0, 0.1  # off its aim by more, a tip goes on slowly
TURN_PER_DEG = 0.02
BEHIND_MM, LEAD_MM = 58.6, 63.86  # the wire in the Cobra; and before it, when the Cobra follows
LOST_MM, LOST_WIRE_MM = 7.7, 9.076  # farther from the target than before: the wrong branch
BACK_MM, BACK_WIRE_MM = 18.0, 14.424  # to before the fork
MOST_BACK, MOST_STUCK, MOST_STUCK_WIRE = 20, 6, 8  # steps
TURNS, TURNS_WIRE, WIRE_TRIES = 8, 4, 2  # steps of turning between tries; tries of the wire
OTHER_DEG, OTHER_WIRE_DEG = 25.957, 70.0  # by which each try aims elsewhere


def unit(vector: Array) -> Array:
    return np.asarray(vector / (np.linalg.norm(vector) + 1e-9))


def angle_about_deg(axis: Array, start: Array, end: Array) -> float:
    """From one direction to another, about an axis; 0 where one of them is along it."""
    start, end = start - (start @ axis) * axis, end - (end @ axis) * axis
    if np.linalg.norm(start) < 0.05 or np.linalg.norm(end) < 0.05:
        return 0.0
    start, end = unit(start), unit(end)
    return float(np.degrees(np.arctan2(np.cross(start, end) @ axis, start @ end)))


def wrapped(angle_deg: float) -> float:
    return (angle_deg + 180) % 360 - 180


class Seen:
    """What an observation tells of the tip that leads, and of the way ahead of it."""

    def __init__(self, observation: Array):
        self.tip = observation[3:6]
        ahead = observation[6:30].reshape(8, 3)
        self.left_mm, self.cobra_mm, self.wire_mm = (float(observation[i]) for i in (30, 31, 36))
        self.way = unit(ahead[1])  # here
        self.onward = unit(ahead[6] - ahead[2]) if self.left_mm > 20 else unit(ahead[3])
        self.bend_deg = float(np.degrees(np.arccos(np.clip(self.way @ self.onward, -1, 1))))

    def turn_to_aim(self, aside_deg: float, share: float) -> float:
        return float(np.clip(share * self.off_aim_deg(aside_deg), -1, 1))

    def off_aim_deg(self, aside_deg: float) -> float:
        """By how much the tip must turn to look to where the way goes, or aside of that."""
        return wrapped(angle_about_deg(self.way, self.tip, self.onward) + aside_deg)


class Policy:
    def __init__(self) -> None:
        self.phase = self.push
        self.best_mm = np.inf  # of what was left of the way
        self.last_mm = np.inf
        self.stuck = self.count = self.tries = self.wire_tries = 0
        self.aside_deg = 0.0
        self.fork: Array | None = None  # the way before it
        self.fork_mm = 0.0  # how far the wire was in at its best

    def __call__(self, observation: Array) -> Action:
        seen = Seen(observation)
        action = self.phase(seen)
        self.last_mm = seen.left_mm
        return action

    # ---- the Cobra --------------------------------------------------------------------------------

    def push(self, seen: Seen) -> Action:
        self.best_mm = min(self.best_mm, seen.left_mm)
        if seen.bend_deg > FORK_DEG and self.fork is None:
            self.fork = seen.way
        elif self.fork is not None and seen.bend_deg < 10 and seen.way @ self.fork > 0.95:
            self.fork = None  # the way was only curved
        is_aimed = seen.bend_deg <= FORK_DEG or abs(seen.off_aim_deg(self.aside_deg)) <= AIMED_DEG
        push = 1.0 if is_aimed else SLOWLY
        self.stuck = self.stuck + 1 if push == 1 and self.last_mm - seen.left_mm < 0.1 else 0
        if seen.left_mm > self.best_mm + LOST_MM:
            self.begin(self.draw_back, seen)
        elif self.stuck > MOST_STUCK or self.has_selected(seen):
            self.begin_wire(seen)
        stays_behind = seen.wire_mm + 0.75 * push * MOST_PUSH_MM <= max(0.0, seen.cobra_mm - BEHIND_MM) + 6
        return push, self.turn_at_fork(seen), push if stays_behind else 0.0, 0.0

    def turn_at_fork(self, seen: Seen) -> float:
        return seen.turn_to_aim(self.aside_deg, TURN_PER_DEG) if seen.bend_deg > 0.6 * FORK_DEG else 0.0

    def has_selected(self, seen: Seen) -> bool:
        return self.fork is not None and seen.way @ self.fork < np.cos(np.radians(SELECTED_DEG)) and seen.tip @ seen.way > 0.6

    def draw_back(self, seen: Seen) -> Action:
        self.best_mm = min(self.best_mm, seen.left_mm)
        self.count += 1
        if seen.left_mm > self.best_mm + BACK_MM or self.count > MOST_BACK:
            self.tries += 1
            self.aside_deg = self.tries // 2 * OTHER_DEG * (1 if self.tries % 2 else -1)
            self.begin(self.turn, seen)
        return -1.0, 0.0, -1.0, 0.0

    def turn(self, seen: Seen) -> Action:
        self.count += 1
        if self.count == TURNS:
            self.begin_wire(seen)
        return 0.0, self.turn_at_fork(seen), 0.0, 0.0

    # ---- the wire ---------------------------------------------------------------------------------

    def begin_wire(self, seen: Seen) -> None:
        self.wire_tries = 0
        self.begin(self.push_wire, seen)
        self.fork_mm = seen.cobra_mm

    def push_wire(self, seen: Seen) -> Action:
        if seen.wire_mm < seen.cobra_mm - 8:
            return 0.0, 0.0, 1.0, 0.0  # to the Cobra's tip
        self.stuck += 1
        if seen.left_mm < self.best_mm - 0.1:
            self.best_mm, self.fork_mm, self.stuck = seen.left_mm, seen.wire_mm, 0
        aside_deg = self.wire_tries * OTHER_WIRE_DEG
        turn = seen.turn_to_aim(aside_deg, 2 * TURN_PER_DEG) if seen.bend_deg > 15 else 0.0
        if seen.left_mm > self.best_mm + LOST_WIRE_MM or self.stuck > MOST_STUCK_WIRE:
            self.wire_tries += 1
            self.begin(self.draw_wire_back, seen)
        return 1.0 if seen.wire_mm - seen.cobra_mm > LEAD_MM else 0.0, 0.0, 1.0, turn

    def draw_wire_back(self, seen: Seen) -> Action:
        if seen.wire_mm > max(self.fork_mm - BACK_WIRE_MM, seen.cobra_mm - 6):
            return 0.0, 0.0, -1.0, 0.0
        if self.wire_tries > WIRE_TRIES:
            self.begin(self.hide_wire, seen)
            return self.hide_wire(seen)
        self.count += 1
        if self.count <= TURNS_WIRE:
            return 0.0, 0.0, 0.0, 1.0
        self.begin(self.push_wire, seen)
        self.best_mm, self.fork_mm = seen.left_mm + 5, seen.wire_mm
        return 0.0, 0.0, 1.0, 0.0

    def hide_wire(self, seen: Seen) -> Action:
        if seen.wire_mm < seen.cobra_mm - BEHIND_MM:
            self.begin(self.push, seen)
        return 0.0, 0.0, -1.0, 0.0

    def begin(self, phase: Any, seen: Seen) -> None:
        self.phase, self.count, self.stuck = phase, 0, 0
        self.best_mm, self.fork = seen.left_mm, None


def steps_to_target(env: gymnasium.Env[Array, Array], seed: int) -> tuple[int | None, dict[str, Any]]:
    """How many steps the policy takes; None where it does not get there. What the episode tells at its end."""
    observation, info = env.reset(seed=seed)
    policy, step = Policy(), 0
    while True:
        observation, _, is_there, is_over, info = env.step(np.array(policy(observation), dtype=np.float32))
        step += 1
        if is_there or is_over:
            return step if is_there else None, info


def environment(tree: str, target: str | None = None) -> Any:
    return ReachTarget(tree, devices=DEVICES, target=target, max_steps=300, ms=STEP_MS, max_push_mm=MOST_PUSH_MM,
                       max_turn_deg=MOST_TURN_DEG)


def main(tree: str, seeds: int) -> None:
    names = {number: branch.name for number, branch in enumerate(xc.VesselTree.read(tree).branches)}
    env, reached = environment(tree), 0
    for seed in range(seeds):
        steps, info = steps_to_target(env, seed)
        reached += steps is not None
        outcome = f"reached in {steps} steps" if steps else f"{info['left_mm']:.0f} mm away"
        print(f"{seed:3}  {names[info['target']] or info['target']}: {outcome}", flush=True)
    print(f"{reached} of {seeds} reached")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) == 3 else 100)
