"""Turns CT scans into fluoroscopy that one can fly through. Not for clinical use.

Arrays are NumPy's: volumes (z, y, x), pictures (rows, columns) with row 0 on top. Points are (x, y, z) in mm, LPS: x
grows towards the patient's left, y towards posterior, z towards superior. Optical depth is tau; transmission is
exp(-tau). Every long call takes `progress`, a callable (fraction, stage) or tqdm, and stops at Ctrl-C.
"""
from . import similarity as similarity
from ._core import (Basis, BloodFlow, BodyMap, Catheter, CatheterState, CoaxialInstruments, Comparison, EditedVessels, Exposure, Fluoroscope, Frame,
                    Frames, Implant, InstrumentShape, Marker, Mesh, Motion, Opacity, RegisteredView, Registration, Run, Scan, VesselBranch, Vessels,
                    VesselTree, __version__, compare, convert, devices, edit, export, flow, open, phantom, register, simulate, track,
                    use_device, vessels)
from ._errors import DeviceError, Error, InputError

__all__ = ["Basis", "BloodFlow", "BodyMap", "Catheter", "CatheterState", "CoaxialInstruments", "Comparison", "DeviceError", "EditedVessels", "Error",
           "Exposure", "Fluoroscope", "Frame", "Frames", "Implant", "InputError", "InstrumentShape", "Marker", "Mesh", "Motion", "Opacity", "RegisteredView", "Registration",
           "Run", "Scan", "VesselBranch", "VesselTree", "Vessels", "compare", "convert", "devices", "edit", "export", "flow", "open", "phantom",
           "register", "simulate", "track", "use_device", "vessels"]
