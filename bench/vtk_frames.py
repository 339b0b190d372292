"""SCAN WIDTH HEIGHT: answers each line `frame` or `opacity` on stdin with the milliseconds that VTK's
fixed-point volume ray caster takes for the next frame, the camera turned by 7 degrees or one knot moved."""
import os
import subprocess
import sys
import time

from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkIOImage import vtkNrrdReader
from vtkmodules.vtkRenderingCore import vtkColorTransferFunction, vtkRenderer, vtkRenderWindow, vtkVolume, vtkVolumeProperty
from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 (registers the window)
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401

# Debian's VTK draws to an X display only: a virtual one, for as long as this runs.
told, tells = os.pipe()
display = subprocess.Popen(["Xvfb", "-displayfd", str(tells)], pass_fds=[tells], stderr=subprocess.DEVNULL)
os.environ["DISPLAY"] = ":" + os.read(told, 16).decode().strip()

reader = vtkNrrdReader()
reader.SetFileName(sys.argv[1])
reader.Update()
image = reader.GetOutput()
# The mapper takes no negative values where it is fast: CT numbers from 0 on.
array = image.GetPointData().GetScalars()
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402
vtk_to_numpy(array)[:] += 1024

opacity = vtkPiecewiseFunction()
for value, mu in ((0, 0.0), (1024, 0.02), (3000, 0.06)):
    opacity.AddPoint(value, mu)
colour = vtkColorTransferFunction()
colour.AddRGBPoint(0, 1, 1, 1)
colour.AddRGBPoint(4096, 1, 1, 1)
look = vtkVolumeProperty()
look.SetScalarOpacity(opacity)
look.SetColor(colour)
look.SetInterpolationTypeToLinear()
mapper = vtkFixedPointVolumeRayCastMapper()
mapper.SetInputData(image)
mapper.AutoAdjustSampleDistancesOff()
mapper.SetSampleDistance(min(image.GetSpacing()))
mapper.SetImageSampleDistance(1)
volume = vtkVolume()
volume.SetMapper(mapper)
volume.SetProperty(look)
renderer = vtkRenderer()
renderer.AddVolume(volume)
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(int(sys.argv[2]), int(sys.argv[3]))
window.AddRenderer(renderer)
camera = renderer.GetActiveCamera()
camera.SetParallelProjection(1)
camera.SetViewUp(0, 0, 1)
camera.SetPosition(0, -1000, 0)
renderer.ResetCamera()
camera.SetParallelScale(0.5 * image.GetDimensions()[2] * image.GetSpacing()[2])

moves = 0
for line in sys.stdin:
    start = time.perf_counter()
    if line.strip() == "opacity":
        moves += 1
        opacity.RemovePoint(1024)
        opacity.AddPoint(1024, 0.02 + 0.001 * (moves % 10))
    else:
        camera.Azimuth(7)
    window.Render()
    print((time.perf_counter() - start) * 1000, flush=True)
window.Finalize()
display.terminate()
