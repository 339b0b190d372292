"""A Gymnasium environment: steer a catheter to a target in a vessel tree."""
import numbers

import numpy as np

from . import Catheter, InputError, InstrumentShape, Motion, VesselTree
from ._pictures import grey_range, greys, project_points

try:
    import gymnasium
except ImportError as error:
    raise ImportError("xraycast.gym needs Gymnasium: pip install gymnasium") from error

AHEAD, AHEAD_MM = 8, 5.0  # points of the way ahead, and how far apart
CONE_MM = (1000, 1500)
VIEW = {"lao": 0.0, "cranial": 0.0, "size": (128, 128), "pixel_mm": None, "centre_mm": None}
LEAST_LEVELS = 24  # of grey, between the catheter and what is beside it, in pixels that are wider than it
ROAD_MAP_MM = 1.6  # the width of the way
MARGIN = 1.1  # of the field about the tree


class _Tree:
    """Ways in a tree, as points (x, y, z) in mm."""

    def __init__(self, tree):
        self.branches = [np.array(tree[i].points)[:, :3] for i in range(len(tree))]
        self.parents = [tree[i].parent for i in range(len(tree))]
        self.arcs = [np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
                     for points in self.branches]
        parents = set(self.parents)
        self.leaves = [i for i in range(len(tree)) if i not in parents]

    def ancestors(self, branch):
        """The branch and those before it, up to the root."""
        line = []
        while branch >= 0:
            line.append(branch)
            branch = self.parents[branch]
        return line

    def way(self, branch, arc_mm, target):
        """From a place on a branch to the end of the branch `target`."""
        back, forth = self.ancestors(branch), self.ancestors(target)
        shared = next((b for b in back if b in forth), -1)
        points, arcs = self.branches[branch], self.arcs[branch]
        here = [np.interp(arc_mm, arcs, points[:, axis]) for axis in range(3)]
        if shared == branch:
            parts = [points[arcs > arc_mm]]
        else:
            parts = [points[arcs < arc_mm][::-1]]
            parts += [self.branches[b][::-1] for b in back[1:back.index(shared) if shared >= 0 else None]]
        parts += [self.branches[b] for b in reversed(forth[:forth.index(shared) if shared >= 0 else None])]
        return np.vstack([[here], *parts])


def _checked_view(body, view):
    """Raises InputError."""
    if body is None:
        for name, value in view.items():
            if not np.array_equal(value, VIEW[name]):
                raise InputError(f"{name}: applies only to frames; give a body too, or leave it out")
        return view
    if not hasattr(body, "render") and not hasattr(body, "project"):
        raise InputError(f"body: must be a BodyMap or a Scan, not {type(body).__name__}")
    for name in ("lao", "cranial"):
        if not isinstance(view[name], numbers.Real) or not np.isfinite(view[name]):
            raise InputError(f"{name}: must be one angle in degrees; the C-arm stays where it is")
    return view


class _Fluoroscope:
    """A C-arm that stays where it is: its picture of the body, to which the instruments are added. Its field is fitted to the
    points of a tree where it is not given. A map that moves does so by `modes`, the names of the motion's."""

    def __init__(self, body, points_mm, modes, *, pixel_mm, centre_mm, **view):
        draw = body.render if hasattr(body, "render") else body.project
        if centre_mm is None:
            centre_mm = tuple((points_mm.min(0) + points_mm.max(0)) / 2)
        if pixel_mm is None:
            probe = draw(cone_mm=CONE_MM, pixel_mm=1, centre_mm=centre_mm, **view)
            reach = np.abs(project_points(points_mm, probe.K, probe.RT)[:, :2] - probe.K[:2, 2]).max(0)
            pixel_mm = float(MARGIN * max(2 * reach / probe.shape[::-1]))
        self.modes = modes if getattr(body, "modes", {}) else []
        if self.modes and list(body.modes) != self.modes:
            raise InputError(f"body: moves by {', '.join(body.modes)}, the motion by {', '.join(self.modes)}; give that of the body")
        self.draw = lambda **instant: draw(cone_mm=CONE_MM, pixel_mm=pixel_mm, centre_mm=centre_mm, **view, **instant)
        self.frame = self.draw()
        self.mm_per_pixel = pixel_mm * CONE_MM[0] / CONE_MM[1]

    def move(self, phases):
        """To an instant of a body that moves."""
        if self.modes:
            self.frame = self.draw(phase=dict(zip(self.modes, phases)))

    def use(self, instrument):
        """How much darker than it is an instrument must be to be seen, and limits that leave room for it in the darkest part."""
        low, high = grey_range(self.frame.tau)
        depth = self._usual_depth(instrument)
        self.gain = max(1.0, LEAST_LEVELS / 255 * (high - low) / depth)
        self.limits = low, high + self.gain * depth

    def _usual_depth(self, instrument):
        """Of a shaft as wide, and of its material, in the middle of the picture."""
        reach_mm = np.linspace(-10, 10, 8)[:, None] * self.mm_per_pixel
        shaft = InstrumentShape(self.frame.centre_mm + reach_mm * self.frame.RT[:2, :3].sum(0), instrument.diameter_mm)
        rows = self.frame.absorption(instruments=shaft).max(axis=1)
        return instrument.per_mm / shaft.per_mm * float(np.median(rows[rows > 0]))

    def shows(self, point_mm):
        column, row, depth_mm = project_points(np.array([point_mm]), self.frame.K, self.frame.RT)[0]
        rows, columns = self.frame.shape
        return depth_mm > 0 and 0 <= column < columns and 0 <= row < rows

    def picture(self, instrument):
        return greys(self.frame.tau + np.float32(self.gain) * self.frame.absorption(instruments=instrument), self.limits)

    def road_map(self, way_mm, arcs_mm):
        marks = np.linspace(0, arcs_mm[-1], max(4, int(arcs_mm[-1] / AHEAD_MM)))
        way = InstrumentShape(np.column_stack([np.interp(marks, arcs_mm, way_mm[:, axis]) for axis in range(3)]), ROAD_MAP_MM)
        return np.where(self.frame.absorption(instruments=way) > 0, np.uint8(255), np.uint8(0))


class ReachTarget(gymnasium.Env, gymnasium.utils.EzPickle):
    """Reach the end of a branch.

    tree: a VesselTree, or its file.  model, entry: as of Catheter, the entry as a branch's number, its vessel's name, or a point.
    target: the number of a leaf, or its vessel's name; default: another leaf in each episode.
    ms: simulated time of a step.  max_push_mm, max_turn_deg: what an action of 1 does in one step.
    max_steps: the number of steps after which an episode is truncated.
    body: a BodyMap or a Scan; then observations are frames. lao, cranial, size, pixel_mm, centre_mm: as in its render or
    project, but the field fits the tree by default. An instrument that would hardly be seen is drawn darker than it is.
    motion, phase: as of Catheter: the body moves about the instrument, at the time of the episode, and so do frames of a body
    that is a map that moves by the same modes (Scan.cast with motion alone); those of any other body stand still.
    observe_phases: observations without a body have the phase of each mode too, at their end.
    breath_hold: actions have a third number, above 0 to hold the mode `breath` of the motion where it is.

    Action, (2,) float32 in [-1, 1]: push and turn at the hub; (3,) with breath_hold.
    Observation, (36,) float32, mm: the tip (x, y, z; where it is in the scan), its direction (3, of length 1), 8 points on the way to the
    target, 5 mm apart, as seen from the tip (24), the way's length, the insertion, the cosine and sine of the hub's
    rotation, and at the hub the force in N and the torque in N mm.
    Observation with a body, (rows, columns, 2) uint8: the fluoroscopic frame, and the road map: 255 on the way from where
    the catheter entered to the target, as it was taken when the episode began.
    Info: target, left_mm: the way's length; and with a motion phases, a dict of its modes.
    Reward: the millimetres by which the way became shorter, less 0.1 per step, and 100 at the target: within 5 mm of
    its end, which also ends the episode.

    Copies and unpickled environments start from the beginning: call reset().
    """

    metadata = {"render_modes": []}
    REACHED_MM, BONUS, PRICE = 5.0, 100.0, 0.1

    def __init__(self, tree, model="cobra-5f", target=None, *, entry=None, ms=10, max_push_mm=2.0, max_turn_deg=10.0,
                 max_steps=2000, body=None, lao=0.0, cranial=0.0, size=(128, 128), pixel_mm=None, centre_mm=None,
                 motion=None, phase=None, observe_phases=False, breath_hold=False):
        gymnasium.utils.EzPickle.__init__(self, tree, model, target, entry=entry, ms=ms, max_push_mm=max_push_mm,
                                          max_turn_deg=max_turn_deg, max_steps=max_steps, body=body, lao=lao,
                                          cranial=cranial, size=size, pixel_mm=pixel_mm, centre_mm=centre_mm,
                                          motion=motion, phase=phase, observe_phases=observe_phases,
                                          breath_hold=breath_hold)
        view = _checked_view(body, dict(lao=lao, cranial=cranial, size=size, pixel_mm=pixel_mm, centre_mm=centre_mm))
        self.vessels = tree if isinstance(tree, VesselTree) else VesselTree.read(tree)
        self.tree, self.model, self.entry = _Tree(self.vessels), model, entry
        if isinstance(target, str):
            target = self._leaf_named(target)
        if target is not None and target not in self.tree.leaves:
            raise InputError(f"target {target}: is not a leaf of the tree; give one of {self.tree.leaves}")
        self.motion = {"motion": motion, "phase": phase}
        self.modes = [] if motion is None else list(Motion.read(motion).modes)
        self.holds_breath = breath_hold
        if breath_hold and "breath" not in self.modes:
            raise InputError("breath_hold: applies to a motion with a mode `breath`; give one, or leave it out")
        if breath_hold and "breath" in (phase or {}):
            raise InputError("breath_hold: the action holds and releases the breath; leave it out of phase")
        self.observes_phases = observe_phases
        if observe_phases and (motion is None or body is not None):
            raise InputError("observe_phases: applies to a motion without a body; give a motion, or leave it out")
        self.target_given, self.ms, self.max_steps = target, ms, max_steps
        self.scale = np.array([max_push_mm, max_turn_deg])
        self.action_space = gymnasium.spaces.Box(-1, 1, (3 if breath_hold else 2,), np.float32)
        self.fluoroscope = None
        if body is not None:
            self.fluoroscope = _Fluoroscope(body, np.vstack(self.tree.branches), self.modes, **view)
            self._check_targets_are_seen()
        if self.fluoroscope:
            self.observation_space = gymnasium.spaces.Box(0, 255, (*self.fluoroscope.frame.shape, 2), np.uint8)
        else:
            phases = len(self.modes) if observe_phases else 0
            self.observation_space = gymnasium.spaces.Box(-1e5, 1e5, (6 + 3 * AHEAD + 6 + phases,), np.float32)

    def _leaf_named(self, name):
        leaves = [branch for branch in self.vessels.named(name) if branch in self.tree.leaves]
        if len(leaves) != 1:
            raise InputError(f'target "{name}": has {len(leaves)} ends; give the number of a leaf')
        return leaves[0]

    def _check_targets_are_seen(self):
        for leaf in self.tree.leaves if self.target_given is None else [self.target_given]:
            if not self.fluoroscope.shows(self.tree.branches[leaf][-1]):
                raise InputError(f"target {leaf}: lies outside of the frames; give another size, pixel_mm or centre_mm, or leave "
                                 "these out")

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.run = Catheter(self.vessels, self.model, entry=self.entry, **self.motion)
        self.target = self.target_given
        if self.target is None:
            away = [leaf for leaf in self.tree.leaves if leaf != self.run.state.branch]
            self.target = int(self.np_random.choice(away or self.tree.leaves))
        self.steps = 0
        way, arcs = self._look_ahead(self.run.state)
        if self.fluoroscope:
            self.fluoroscope.move(self.run.state.phases)
            self.fluoroscope.use(self.run.shape)
            self.road_map = self.fluoroscope.road_map(way, arcs)
        return self._observe(self.run.state), self._info()

    def step(self, action):
        action = np.clip(np.asarray(action, dtype=np.float64), -1, 1)
        push_mm, turn_deg = action[:2] * self.scale
        if self.holds_breath:
            self.run.hold("breath", bool(action[2] > 0))
        before_mm = self.left_mm
        state = self.run.step(push_mm=float(push_mm), turn_deg=float(turn_deg), ms=self.ms)
        self.steps += 1
        observation = self._observe(state)
        is_there = bool(self.left_mm < self.REACHED_MM)
        reward = before_mm - self.left_mm - self.PRICE + (self.BONUS if is_there else 0)
        return observation, float(reward), is_there, self.steps >= self.max_steps, self._info()

    def _look_ahead(self, state):
        """The way to the target, and how far each of its points is."""
        way = self.tree.way(state.branch, state.arc_length_mm, self.target)
        arcs = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
        self.left_mm = float(arcs[-1])
        return way, arcs

    def _observe(self, state):
        way, arcs = self._look_ahead(state)
        if self.fluoroscope:
            self.fluoroscope.move(state.phases)
            return np.stack([self.fluoroscope.picture(self.run.shape), self.road_map], axis=-1)
        tip = np.array(state.tip_scan_mm)
        marks = AHEAD_MM * np.arange(1, AHEAD + 1)
        ahead = np.column_stack([np.interp(marks, arcs, way[:, axis]) for axis in range(3)]) - tip
        turn = np.radians(state.rotation_deg)
        values = [*tip, *state.tip_direction, *ahead.ravel(), self.left_mm, state.insertion_mm, np.cos(turn),
                   np.sin(turn), state.force_N, 1000 * state.torque_Nm]
        if self.observes_phases:
            values += state.phases
        return np.array(values, dtype=np.float32)

    def _info(self):
        info = {"target": self.target, "left_mm": self.left_mm}
        if self.modes:
            info["phases"] = dict(zip(self.modes, self.run.state.phases))
        return info
