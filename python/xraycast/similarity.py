"""How alike two pictures are, whatever their brightness and contrast.

Each function takes `fixed` and `moving`, arrays of one shape, and `mask`, whose pixels count where it is not 0. It returns the
value and its derivatives by the moving picture's pixels, an array of that shape.
"""
from ._core import gradient_ncc, mutual_information, ncc

__all__ = ["gradient_ncc", "mutual_information", "ncc"]
