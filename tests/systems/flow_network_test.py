"""Lumped networks of blood vessels against SimVascular's svZeroDSolver, PyPI's svzerod, on its own kinds of cases.

usage: flow_network_test.py TRACE, by an interpreter that has svzerod; TRACE: the program of flow_network_trace.cpp.
Each case is stated twice: in svZeroDSolver's JSON, and as nodes of a FlowNetwork. Units are cgs, as in svZeroDSolver's own cases.
"""
import json
import subprocess
import sys

SKIPPED = 77
POINTS, BEATS = 401, 30  # of svZeroDSolver in a beat of 1 s, first and last being the same phase
# Of the range of a pressure or a flow. Both schemes are of second order, with steps of 1/400 of a beat; they differ by 0.02 %.
TOLERANCE = 0.001


class Case:
    """A network that is built up from its inlet."""

    def __init__(self, inlet, values):
        self.nodes, self.inflow, self.given, self.watched = [{}], {}, {}, []
        self.vessels, self.junctions = [], []
        self.boundaries = [{"bc_name": "IN", "bc_type": inlet.upper(), "bc_values": {"flow": {"Q": values}, "pressure": {"P": values}}[inlet] | {"t": TIMES}}]
        if inlet == "flow":
            self.inflow[0] = values[1:]
        else:
            self.nodes[0]["is_held"] = True
            self.given[0] = values[1:]

    def add(self, parent, **constants):
        self.nodes.append({"parent": parent, **constants})
        return len(self.nodes) - 1

    def hold(self, parent, resistance, pressure):
        self.given[self.add(parent, resistance=resistance, is_held=True)] = [pressure] * (POINTS - 1)

    def vessel(self, behind, r, c=0.0, l=0.0, s=0.0):
        """Behind the node of another one, or the inlet's 0; returns the number of the vessel, and its last node."""
        number = len(self.vessels)
        values = {"R_poiseuille": r, "C": c, "L": l, "stenosis_coefficient": s}
        self.vessels.append({"vessel_id": number, "vessel_name": f"branch{number}_seg0", "vessel_length": 1.0,
                             "zero_d_element_type": "BloodVessel", "zero_d_element_values": values})
        first = end = self.add(behind, resistance=r, quadratic_loss=s, compliance=c)
        if l > 0:
            end = self.add(end, inertance=l)
        if behind == 0 and number == 0:
            self.vessels[0]["boundary_conditions"] = {"inlet": "IN"}
        self.watched.append((number, behind, first, end))
        return number, end

    def outlet(self, vessel, kind, **values):
        number, end = vessel
        name = f"OUT{number}"
        self.boundaries.append({"bc_name": name, "bc_type": kind, "bc_values": values | ({"t": TIMES} if kind == "CORONARY" else {})})
        self.vessels[number].setdefault("boundary_conditions", {})["outlet"] = name
        if kind == "RESISTANCE":
            self.hold(end, values["R"], values["Pd"])
        elif kind == "RCR":
            self.hold(self.add(end, resistance=values["Rp"], compliance=values["C"]), values["Rd"], values["Pd"])
        else:
            arterial = self.add(end, resistance=values["Ra1"], compliance=values["Ca"])
            wall = self.add(arterial, resistance=values["Ra2"], compliance=values["Cc"])
            self.given[wall] = values["Pim"][1:]
            self.hold(wall, values["Rv1"], values["P_v"])

    def divide(self, parent, *children):
        self.junctions.append({"junction_name": f"J{len(self.junctions)}", "junction_type": "NORMAL_JUNCTION",
                               "inlet_vessels": [parent[0]], "outlet_vessels": [child[0] for child in children]})

    def differences(self, trace, svzerod):
        """Of each pressure and flow at the ends of vessels, as a share of its range, or of its mean if it is steady."""
        ours = json.loads(subprocess.run([trace], check=True, capture_output=True, text=True, input=json.dumps(
            {"nodes": self.nodes, "step": 1 / (POINTS - 1), "beats": BEATS, "inflow": self.inflow, "given": self.given})).stdout)
        theirs = svzerod.simulate({
            "simulation_parameters": {"number_of_cardiac_cycles": BEATS, "number_of_time_pts_per_cardiac_cycle": POINTS,
                                      "output_all_cycles": False, "output_variable_based": False, "steady_initial": True,
                                      "absolute_tolerance": 1e-9},
            "boundary_conditions": self.boundaries, "junctions": self.junctions, "vessels": self.vessels})
        for number, before, first, end in self.watched:
            rows = theirs[theirs.name == f"branch{number}_seg0"]
            for column, of, node in (("flow_in", "flow", first), ("flow_out", "flow", end),
                                     ("pressure_in", "pressure", before), ("pressure_out", "pressure", end)):
                reference = rows[column].to_numpy()[1:]
                mine = [step[node] for step in ours[of]]
                spread = reference.max() - reference.min()
                scale = spread if spread > 1e-3 * abs(reference).max() else abs(reference).max()
                yield f"{column} of {number}", max(abs(a - b) for a, b in zip(mine, reference)) / scale


TIMES = [i / (POINTS - 1) for i in range(POINTS)]


def cases():
    import math
    pulse = [50 + 40 * math.sin(2 * math.pi * t) + 15 * math.cos(4 * math.pi * t) for t in TIMES]
    steady = [5.0] * POINTS
    ventricle = [8e4 * max(0.0, math.sin(2 * math.pi * t)) ** 2 for t in TIMES]

    case = Case("flow", steady)
    case.outlet(case.vessel(0, 100.0), "RESISTANCE", R=100.0, Pd=0.0)
    yield "steady flow, R, resistance", case
    case = Case("flow", steady)
    case.outlet(case.vessel(0, 100.0, c=1e-4, l=1.0), "RCR", Rp=100.0, C=1e-4, Rd=900.0, Pd=0.0)
    yield "steady flow, RLC, RCR", case
    case = Case("flow", steady)
    case.outlet(case.vessel(0, 100.0, s=20.0), "RESISTANCE", R=100.0, Pd=0.0)
    yield "steady flow, stenosis, resistance", case
    case = Case("flow", pulse)
    case.outlet(case.vessel(0, 100.0), "RCR", Rp=121.0, C=1.5e-4, Rd=1212.0, Pd=0.0)
    yield "pulsatile flow, R, RCR", case
    case = Case("flow", pulse)
    case.outlet(case.vessel(0, 50.0, c=1e-4, l=2.0), "RCR", Rp=121.0, C=1.5e-4, Rd=1212.0, Pd=1e3)
    yield "pulsatile flow, RLC, RCR", case
    case = Case("flow", pulse)
    case.outlet(case.vessel(0, 20.0, c=2e-5, l=1.0, s=3.0), "RCR", Rp=100.0, C=1.5e-4, Rd=1000.0, Pd=0.0)
    yield "pulsatile flow, stenosis, RCR", case
    case = Case("pressure", [1e4 + 2e3 * math.sin(2 * math.pi * t) for t in TIMES])
    case.outlet(case.vessel(0, 20.0, c=1e-5, l=2.0, s=1.0), "RESISTANCE", R=100.0, Pd=1e3)
    yield "pulsatile pressure, stenosis, resistance", case
    case = Case("flow", [0.1 * q for q in pulse])
    case.outlet(case.vessel(0, 100.0), "CORONARY", Ra1=1e3, Ra2=2e3, Ca=1e-5, Cc=5e-5, Rv1=1e3, P_v=5e3, Pim=ventricle)
    yield "pulsatile flow, R, coronary", case
    case = Case("flow", pulse)
    parent = case.vessel(0, 20.0, c=1e-5, l=1.0)
    left, right = case.vessel(parent[1], 60.0, l=3.0), case.vessel(parent[1], 30.0, c=1e-5, l=2.0, s=0.5)
    case.divide(parent, left, right)
    case.outlet(left, "RCR", Rp=100.0, C=1e-4, Rd=1000.0, Pd=0.0)
    case.outlet(right, "RCR", Rp=200.0, C=2e-4, Rd=800.0, Pd=0.0)
    yield "pulsatile flow, bifurcation, RCR", case
    case = Case("flow", pulse)
    parent = case.vessel(0, 20.0, l=1.0)
    aorta, coronary = case.vessel(parent[1], 10.0, c=1e-5, l=1.0), case.vessel(parent[1], 200.0, l=5.0, s=5.0)
    case.divide(parent, aorta, coronary)
    case.outlet(aorta, "RCR", Rp=100.0, C=5e-4, Rd=1200.0, Pd=0.0)
    case.outlet(coronary, "CORONARY", Ra1=6e3, Ra2=1e4, Ca=2e-6, Cc=1.5e-5, Rv1=3e3, P_v=5e3, Pim=ventricle)
    yield "pulsatile flow, aorta and coronary", case


def main(trace):
    try:
        import svzerod
    except ImportError as error:
        print(f"skipped: {error}")
        return SKIPPED
    faults = 0
    for name, case in cases():
        where, largest = max(case.differences(trace, svzerod), key=lambda pair: pair[1])
        print(f"{name}: {100 * largest:.3f} % of the range, in {where}")
        faults += not largest <= TOLERANCE
    return faults


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
