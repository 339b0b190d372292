"""A Gymnasium environment: steer a catheter to a target in a vessel tree."""
import copy
import numbers

import numpy as np

from . import CoaxialInstruments, Error, InputError, InstrumentShape, Motion, VesselTree
from ._pictures import grey_range, greys, project_points

try:
    import gymnasium
except ImportError as error:
    raise ImportError("xraycast.gym needs Gymnasium: pip install gymnasium") from error

AHEAD, AHEAD_MM = 8, 5.0  # points of the way ahead, and how far apart
CONE_MM = (1000, 1500)
VIEW = {"lao": 0.0, "cranial": 0.0, "size": (128, 128), "pixel_mm": None, "centre_mm": None, "field_mm": None}
LEAST_LEVELS = 24  # of grey, between the catheter and what is beside it, in pixels that are wider than it
ROAD_MAP_MM = 1.6  # the width of the way
MARGIN = 1.1  # of the field about the tree
RENDERED = 256  # pixels of the longer side of a picture without a body
ENTERED = 20.0  # what an entry into a forbidden vessel costs


class _Tree:
    """Ways in a tree, as points (x, y, z) in mm."""

    def __init__(self, tree):
        self.branches = [np.array(tree[i].points)[:, :3] for i in range(len(tree))]
        self.radii = [np.array(tree[i].points)[:, 3] for i in range(len(tree))]
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

    def place(self, branch, arc_mm):
        return np.array([np.interp(arc_mm, self.arcs[branch], self.branches[branch][:, axis]) for axis in range(3)])

    def between(self, branch, from_mm, to_mm):
        """The points of a branch that lie between two places on it, in that direction."""
        points, arcs = self.branches[branch], self.arcs[branch]
        return points[(arcs > from_mm) & (arcs < to_mm)] if from_mm < to_mm else points[(arcs > to_mm) & (arcs < from_mm)][::-1]

    def way(self, branch, arc_mm, target, target_mm=None):
        """From a place on a branch to one on the branch `target`, by default its end."""
        target_mm = self.arcs[target][-1] if target_mm is None else target_mm
        back, forth = self.ancestors(branch), self.ancestors(target)
        shared = next((b for b in back if b in forth), -1)
        ends = [[self.place(branch, arc_mm)], [self.place(target, target_mm)]]
        if branch == target:
            return np.vstack([ends[0], self.between(branch, arc_mm, target_mm), ends[1]])
        # Every branch leaves the end of the one before it.
        parts = [self.between(branch, arc_mm, np.inf if shared == branch else -1)]
        parts += [self.branches[b][::-1] for b in back[1:back.index(shared) if shared >= 0 else None]]
        parts += [self.branches[b] for b in reversed(forth[1:forth.index(shared) if shared >= 0 else None])]
        parts.append(self.between(target, np.inf if shared == target else -1, target_mm))
        return np.vstack([ends[0], *parts, ends[1]])


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
    field_mm = view["field_mm"]
    if field_mm is not None and not (isinstance(field_mm, numbers.Real) and 1 <= field_mm <= 1000):
        raise InputError(f"field_mm {field_mm}: must be 1 to 1000")
    for name in ("pixel_mm", "centre_mm"):
        if field_mm is not None and view[name] is not None:
            raise InputError(f"{name}: field_mm says how large frames are, and they follow the tip; leave one of both out")
    return view


class _Fluoroscope:
    """A C-arm that keeps its angles: its picture of the body, to which the instruments are added. Its field is fitted to the
    points of a tree where it is not given; with field_mm it is so wide, and the table follows the tip. A map that moves does so by
    `modes`, the names of the motion's."""

    def __init__(self, body, points_mm, modes, *, pixel_mm, centre_mm, field_mm, **view):
        draw = body.render if hasattr(body, "render") else body.project
        if centre_mm is None:
            centre_mm = tuple((points_mm.min(0) + points_mm.max(0)) / 2)
        self.follows = field_mm is not None
        if self.follows:
            pixel_mm = float(field_mm) / max(view["size"]) * CONE_MM[1] / CONE_MM[0]
        if pixel_mm is None:
            probe = draw(cone_mm=CONE_MM, pixel_mm=1, centre_mm=centre_mm, **view)
            reach = np.abs(project_points(points_mm, probe.K, probe.RT)[:, :2] - probe.K[:2, 2]).max(0)
            pixel_mm = float(MARGIN * max(2 * reach / probe.shape[::-1]))
        self.modes = modes if getattr(body, "modes", {}) else []
        if self.modes and list(body.modes) != self.modes:
            raise InputError(f"body: moves by {', '.join(body.modes)}, the motion by {', '.join(self.modes)}; give that of the body")
        self.draw = lambda centre_mm=centre_mm, **instant: draw(cone_mm=CONE_MM, pixel_mm=pixel_mm, centre_mm=centre_mm, **view, **instant)
        self.frame = self.draw()
        self.mm_per_pixel = pixel_mm * CONE_MM[0] / CONE_MM[1]

    def move(self, phases, tip_mm):
        """To an instant of a body that moves, and to a tip that is followed."""
        instant = {"phase": dict(zip(self.modes, phases))} if self.modes else {}
        if self.follows:
            instant["centre_mm"] = tuple(tip_mm)
        if instant:
            self.frame = self.draw(**instant)

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


def _drawn(tree, nodes_mm, place_mm):
    """A picture from the front without a body: the vessels, the instruments, and the target. (rows, columns, 3) uint8"""
    points = np.vstack(tree.branches)
    low, high = points.min(0) - 10, points.max(0) + 10
    mm = max(high[0] - low[0], high[2] - low[2]) / RENDERED
    picture = np.full((int((high[2] - low[2]) / mm) + 1, int((high[0] - low[0]) / mm) + 1, 3), 24, np.uint8)

    def dot(line_mm, radii_mm, colour):
        for point, radius in zip(line_mm, radii_mm):
            column, row, reach = (point[0] - low[0]) / mm, (high[2] - point[2]) / mm, max(0.6, radius / mm)
            rows, columns = np.ogrid[:picture.shape[0], :picture.shape[1]]
            picture[(rows - row) ** 2 + (columns - column) ** 2 <= reach ** 2] = colour

    def dense(line_mm, *values):
        arcs = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line_mm, axis=0), axis=1))])
        marks = np.arange(0, arcs[-1] + mm, mm)
        return [np.column_stack([np.interp(marks, arcs, line_mm[:, axis]) for axis in range(3)]), *(np.interp(marks, arcs, v) for v in values)]

    for line, radii in zip(tree.branches, tree.radii):
        dot(*dense(line, radii), (90, 96, 104))
    dot([place_mm], [3], (255, 209, 89))
    for nodes in nodes_mm:
        line, = dense(np.asarray(nodes))
        dot(line, np.full(len(line), 0.0), (255, 255, 255))
    return picture


class _Window:
    """Shows pictures."""

    SHOWN = 512  # pixels of the longer side, about

    def __init__(self):
        try:
            import tkinter
        except ImportError as error:
            raise ImportError('render_mode "human" needs tkinter, such as Debian\'s python3-tk; or use "rgb_array"') from error
        try:
            self.root = tkinter.Tk(className="xraycast")
        except tkinter.TclError as error:
            raise InputError(f'render_mode "human": there is no display ({error}); use "rgb_array"') from error
        self.tkinter, self.image = tkinter, None
        self.root.title("xraycast")
        self.label = tkinter.Label(self.root, borderwidth=0)
        self.label.pack()

    def show(self, picture):
        times = max(1, round(self.SHOWN / max(picture.shape[:2])))
        picture = picture.repeat(times, axis=0).repeat(times, axis=1)
        rows, columns = picture.shape[:2]
        try:
            self.image = self.tkinter.PhotoImage(master=self.root, data=b"P6 %d %d 255\n" % (columns, rows) + picture.tobytes(), format="PPM")
            self.label.configure(image=self.image)
            self.root.update()
        except self.tkinter.TclError as error:
            raise Error("the window was closed") from error

    def close(self):
        try:
            self.root.destroy()
        except self.tkinter.TclError:  # by its user
            pass


class ReachTarget(gymnasium.Env, gymnasium.utils.EzPickle):
    """Reach the end of a branch, or the targets of an exercise. `gymnasium.make("xraycast/ReachTarget-v0", tree=...)`, once this
    module is imported.

    tree: a VesselTree, or its file.  model, entry: as of Catheter, the entry as a branch's number, its vessel's name, or a point.
    devices: several instruments, the outermost first, in place of model.
    target: the number of a leaf, or its vessel's name; default: another leaf in each episode.
    exercise: a file of a task (docs/exercises.md), with its own targets, instruments and entry.
    ms: simulated time of a step.  max_push_mm, max_turn_deg: what an action of 1 does in one step.
    max_steps: the number of steps after which an episode is truncated.
    body: a BodyMap or a Scan; then observations are frames. lao, cranial, size, pixel_mm, centre_mm: as in its render or
    project, but the field fits the tree by default. field_mm: instead frames follow the tip, and their longer side shows so much
    about it. An instrument that would hardly be seen is drawn darker than it is.
    motion, phase: as of Catheter: the body moves about the instrument, at the time of the episode, and so do frames of a body
    that is a map that moves by the same modes (Scan.cast with motion alone); those of any other body stand still.
    observe_phases: observations without a body have the phase of each mode too, at their end.
    breath_hold: actions have a number more, above 0 to hold the mode `breath` of the motion where it is.
    render_mode: "rgb_array": render() is the frame, or without a body a sketch from the front. "human": a window shows it at each
    step; it needs a display and Python's tkinter.

    Action, (2,) float32 in [-1, 1]: push and turn at the hub, of each instrument; one more with breath_hold.
    Observation, (36,) float32, mm: the tip (x, y, z; where it is in the scan), its direction (3, of length 1), 8 points on the way to the
    target, 5 mm apart, as seen from the tip (24), the way's length, the insertion, the cosine and sine of the hub's
    rotation, and at the hub the force in N and the torque in N mm. Of several instruments the tip is the one nearest to the
    target, or that of the exercise's instrument, and the last five numbers are repeated for each.
    Observation with a body, (rows, columns, 2) uint8: the fluoroscopic frame, and the road map: 255 on the way from where
    the catheter entered to the target, as it was taken when the episode began, or of an exercise when the target before was reached.
    Info: target, left_mm: the way's length; report: what Catheter.report() gives; and with a motion phases, a dict of its modes.
    Reward: the millimetres by which the way became shorter, less 0.1 per step, and 100 at the target: within 5 mm of
    its end, which also ends the episode. In an exercise 100 at each target, and 20 less for each entry into a forbidden vessel;
    the last target ends the episode.

    Copies and unpickled environments start from the beginning: call reset().
    """

    metadata = {"render_modes": ["rgb_array", "human"], "render_fps": 20}
    REACHED_MM, BONUS, PRICE = 5.0, 100.0, 0.1

    def __init__(self, tree, model="cobra-5f", target=None, *, entry=None, ms=10, max_push_mm=2.0, max_turn_deg=10.0,
                 max_steps=2000, body=None, lao=0.0, cranial=0.0, size=(128, 128), pixel_mm=None, centre_mm=None,
                 motion=None, phase=None, observe_phases=False, breath_hold=False, devices=None, exercise=None, render_mode=None,
                 field_mm=None):
        gymnasium.utils.EzPickle.__init__(self, tree, model, target, entry=entry, ms=ms, max_push_mm=max_push_mm,
                                          max_turn_deg=max_turn_deg, max_steps=max_steps, body=body, lao=lao,
                                          cranial=cranial, size=size, pixel_mm=pixel_mm, centre_mm=centre_mm,
                                          motion=motion, phase=phase, observe_phases=observe_phases,
                                          breath_hold=breath_hold, devices=devices, exercise=exercise, render_mode=render_mode,
                                          field_mm=field_mm)
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"render_mode {render_mode}: must be rgb_array, human or None")
        self.render_mode, self.window = render_mode, None
        view = _checked_view(body, dict(lao=lao, cranial=cranial, size=size, pixel_mm=pixel_mm, centre_mm=centre_mm, field_mm=field_mm))
        self.vessels = tree if isinstance(tree, VesselTree) else VesselTree.read(tree)
        self.tree, self.entry = _Tree(self.vessels), entry
        self.task = None if exercise is None else self.vessels.exercise(exercise)
        if self.task and target is not None:
            raise InputError("target: the exercise has its own; leave it out")
        self.models = list(devices) if devices is not None else self.task["instruments"] if self.task else [model]
        if isinstance(target, str):
            target = self._leaf_named(target)
        if target is not None and target not in self.tree.leaves:
            raise InputError(f"target {target}: is not a leaf of the tree; give one of {self.tree.leaves}")
        self.motion = {"motion": motion, "phase": phase, "exercise": exercise}
        self.modes = [] if motion is None else list(Motion.read(motion).modes)
        self.holds_breath = breath_hold
        if breath_hold and "breath" not in self.modes:
            raise InputError("breath_hold: applies to a motion with a mode `breath`; give one, or leave it out")
        if breath_hold and "breath" in (phase or {}):
            raise InputError("breath_hold: the action holds and releases the breath; leave it out of phase")
        self.observes_phases = observe_phases
        if observe_phases and (motion is None or body is not None):
            raise InputError("observe_phases: applies to a motion without a body; give a motion, or leave it out")
        for name, value in ("ms", ms), ("max_push_mm", max_push_mm), ("max_turn_deg", max_turn_deg), ("max_steps", max_steps):
            if not isinstance(value, numbers.Real) or not 0 < value < np.inf:
                raise InputError(f"{name} {value!r}: must be a number above 0")
        self.target_given, self.ms, self.max_steps = target, ms, max_steps
        self.scale = np.array([max_push_mm, max_turn_deg])
        self.action_space = gymnasium.spaces.Box(-1, 1, (2 * len(self.models) + (1 if breath_hold else 0),), np.float32)
        self.fluoroscope = None
        if body is not None:
            self.fluoroscope = _Fluoroscope(body, np.vstack(self.tree.branches), self.modes, **view)
            self._check_targets_are_seen()
        if self.fluoroscope:
            self.observation_space = gymnasium.spaces.Box(0, 255, (*self.fluoroscope.frame.shape, 2), np.uint8)
        else:
            phases = len(self.modes) if observe_phases else 0
            self.observation_space = gymnasium.spaces.Box(-1e5, 1e5, (6 + 3 * AHEAD + 1 + 5 * len(self.models) + phases,), np.float32)

    def _leaf_named(self, name):
        leaves = [branch for branch in self.vessels.named(name) if branch in self.tree.leaves]
        if len(leaves) != 1:
            raise InputError(f'target "{name}": has {len(leaves)} ends; give the number of a leaf')
        return leaves[0]

    def _check_targets_are_seen(self):
        if self.fluoroscope.follows:
            return
        leaves = self.tree.leaves if self.target_given is None else [self.target_given]
        places = [(target["branch"], target["at_mm"]) for target in self.task["targets"]] if self.task else [
            (leaf, self.tree.branches[leaf][-1]) for leaf in leaves]
        for branch, at_mm in places:
            if not self.fluoroscope.shows(at_mm):
                raise InputError(f"target {branch}: lies outside of the frames; give another size, pixel_mm or centre_mm, or leave "
                                 "these out")

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.run = CoaxialInstruments(self.vessels, self.models, entry=self.entry, **self.motion)
        self.states, self.report = self.run.states, self.run.report()
        self.target = self.target_given
        if self.target is None and not self.task:
            away = [leaf for leaf in self.tree.leaves if leaf != self.states[0].branch]
            self.target = int(self.np_random.choice(away or self.tree.leaves))
        self.steps = 0
        self._aim()
        ahead = self._look_ahead()
        if not self.task and self.left_mm < self.REACHED_MM:
            raise InputError(f"target {self.target}: is where the instruments enter; give another one, or another entry")
        if self.fluoroscope:
            self._take_road_map(ahead)
        observation = self._observe(ahead, is_first=True)
        if self.render_mode == "human":
            self.render()
        return observation, self._info()

    def _take_road_map(self, ahead):
        """Of the way to the target, which frames show from now on."""
        self.way, self.road_map = ahead[:2], None

    def _aim(self):
        """At the target that is next."""
        self.target_mm, self.instrument = None, None
        if self.task:
            targets = self.task["targets"]
            aim = targets[min(self._reached(self.report), len(targets) - 1)]
            self.target, self.target_mm, self.instrument = aim["branch"], aim["arc_length_mm"], aim["instrument"]

    @staticmethod
    def _reached(report):
        return sum(target["reached_s"] is not None for target in report["exercise"]["targets"])

    def step(self, action):
        self._check_is_reset()
        action = np.asarray(action, dtype=np.float64)
        if action.shape != self.action_space.shape:
            raise InputError(f"action: has shape {action.shape}; give {self.action_space.shape}, push and turn of each instrument"
                             + (" and the breath" if self.holds_breath else ""))
        action = np.clip(action, -1, 1)
        count = len(self.models)
        moves = action[:2 * count].reshape(count, 2) * self.scale
        if self.holds_breath:
            self.run.hold("breath", bool(action[2 * count] > 0))
        before_mm, before = self.left_mm, self.report
        self.states = self.run.step(push_mm=moves[:, 0], turn_deg=moves[:, 1], ms=self.ms)
        self.report = self.run.report()
        self.steps += 1
        ahead = self._look_ahead()
        reward = before_mm - self.left_mm - self.PRICE
        if self.task:
            now, then = self.report["exercise"], before["exercise"]
            gained = self._reached(self.report) - self._reached(before)
            reward += self.BONUS * gained - ENTERED * (len(now["forbidden_entries"]) - len(then["forbidden_entries"]))
            is_there = now["is_complete"]
            self._aim()
            if gained:
                ahead = self._look_ahead()
                if self.fluoroscope and not is_there:
                    self._take_road_map(ahead)
        else:
            is_there = bool(self.left_mm < self.REACHED_MM)
            reward += self.BONUS if is_there else 0
        observation = self._observe(ahead)
        if self.render_mode == "human":
            self.render()
        return observation, float(reward), is_there, self.steps >= self.max_steps, self._info()

    def _check_is_reset(self):
        if not hasattr(self, "run"):
            raise InputError("no episode has begun; call reset() first")

    def _look_ahead(self):
        """The way to the target from the tip that is to reach it, how far each of its points is, and the state of that instrument:
        that of the exercise or, where any may, the one nearest to it."""
        best = None
        for state in self.states if self.instrument is None else [self.states[self.instrument]]:
            way = self.tree.way(state.branch, state.arc_length_mm, self.target, self.target_mm)
            arcs = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
            if best is None or arcs[-1] < best[1][-1]:
                best = way, arcs, state
        self.left_mm = float(best[1][-1])
        return best

    def _observe(self, ahead, is_first=False):
        way, arcs, state = ahead
        if self.fluoroscope:
            self.fluoroscope.move(state.phases, state.tip_mm)
            if is_first or self.fluoroscope.follows:
                self.fluoroscope.use(self.run.shapes[0])
            if self.road_map is None or self.fluoroscope.follows:
                self.road_map = self.fluoroscope.road_map(*self.way)
            return np.stack([self.fluoroscope.picture(self.run.shapes), self.road_map], axis=-1)
        tip = np.array(state.tip_scan_mm)
        marks = AHEAD_MM * np.arange(1, AHEAD + 1)
        ahead = np.column_stack([np.interp(marks, arcs, way[:, axis]) for axis in range(3)]) - tip
        values = [*tip, *state.tip_direction, *ahead.ravel(), self.left_mm]
        for hub in self.states:
            turn = np.radians(hub.rotation_deg)
            values += [hub.insertion_mm, np.cos(turn), np.sin(turn), hub.force_N, 1000 * hub.torque_Nm]
        if self.observes_phases:
            values += state.phases
        return np.array(values, dtype=np.float32)

    def _info(self):
        info = {"target": self.target, "left_mm": self.left_mm, "report": copy.deepcopy(self.report)}
        if self.modes:
            info["phases"] = dict(zip(self.modes, self.states[0].phases))
        return info

    def render(self):
        """(rows, columns, 3) uint8; None without a render_mode, and with "human", which shows it in a window."""
        if self.render_mode is None:
            return None
        self._check_is_reset()
        if self.render_mode == "rgb_array":
            return self._picture()
        if self.window is None:
            self.window = _Window()
        self.window.show(self._picture())
        return None

    def close(self):
        if self.window is not None:
            self.window.close()
            self.window = None

    def _picture(self):
        if not self.fluoroscope:
            place = self.tree.branches[self.target][-1] if self.target_mm is None else self.tree.place(self.target, self.target_mm)
            return _drawn(self.tree, [self.run.nodes_mm(d) for d in range(len(self.models))], place)
        picture = np.repeat(self.fluoroscope.picture(self.run.shapes)[..., None], 3, axis=-1)
        way = self.road_map > 0
        picture[way] = picture[way] // 2 + np.array([127, 104, 44], np.uint8)
        return picture


gymnasium.register(id="xraycast/ReachTarget-v0", entry_point="xraycast.gym:ReachTarget")
