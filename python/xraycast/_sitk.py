"""Scans to and from SimpleITK images, where SimpleITK is installed."""
from ._core import Scan
from ._errors import Error


def _sitk():
    try:
        import SimpleITK
    except ImportError:
        raise Error("SimpleITK is not installed: pip install SimpleITK") from None
    return SimpleITK


def to_sitk(scan):
    image = _sitk().GetImageFromArray(scan.hu)
    image.SetSpacing(scan.spacing_mm)
    image.SetOrigin(scan.origin_mm)
    return image


def from_sitk(image):
    sitk = _sitk()
    if image.GetDimension() == 3 and image.GetNumberOfComponentsPerPixel() == 1:
        image = sitk.Clamp(image, sitk.sitkInt16, -1024, 32767)
    direction = [image.GetDirection()[i:i + 3] for i in (0, 3, 6)]
    return Scan.from_array(sitk.GetArrayFromImage(image), image.GetSpacing(), image.GetOrigin(), direction)
