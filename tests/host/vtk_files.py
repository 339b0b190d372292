"""What VTK makes of our files, and files by VTK for us to read; run by vtk_files_test.

vtk_files.py describe FILE                          prints JSON
vtk_files.py write FILE ascii|binary|appended|raw none|zlib 32|64 little|big short|float|...
vtk_files.py write_legacy FILE ascii|binary [42|51]  .vtk, .ply or .obj
"""
import json
import sys

import vtk


def names_and_values(attributes):
    arrays = [attributes.GetArray(i) for i in range(attributes.GetNumberOfArrays())]
    return {a.GetName(): [a.GetTuple1(i) for i in range(a.GetNumberOfTuples())] for a in arrays}


def describe(file):
    reader = vtk.vtkSTLReader() if file.endswith(".stl") else vtk.vtkXMLPolyDataReader()
    reader.SetFileName(file)
    reader.Update()
    data = reader.GetOutput()
    edges = vtk.vtkFeatureEdges()
    edges.SetInputData(data)
    edges.FeatureEdgesOff()
    edges.Update()
    mass = vtk.vtkMassProperties()
    mass.SetInputData(data)
    space = data.GetFieldData().GetAbstractArray("SPACE")
    print(json.dumps({
        "points": [data.GetPoint(i) for i in range(data.GetNumberOfPoints())],
        "lines": data.GetNumberOfLines(),
        "polys": data.GetNumberOfPolys(),
        "open_edges": edges.GetOutput().GetNumberOfCells(),
        "volume": mass.GetVolume() if data.GetNumberOfPolys() else 0,
        "point_arrays": names_and_values(data.GetPointData()),
        "cell_arrays": names_and_values(data.GetCellData()),
        "int_arrays": all(data.GetCellData().GetArray(i).IsA("vtkIntArray")
                          for i in range(data.GetCellData().GetNumberOfArrays())),
        "space": reader.GetHeader() if file.endswith(".stl") else space.GetValue(0),
    }))


def sphere():
    sphere = vtk.vtkSphereSource()
    sphere.SetThetaResolution(80)
    sphere.SetPhiResolution(40)
    sphere.SetRadius(10)
    return sphere


def sphere_writer():
    source = sphere()
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetInputConnection(source.GetOutputPort())
    return writer


def image_writer(number_type):
    """11 x 12 x 13 voxels from index (2, -1, 0) on, of value x + 10 y + 100 z; the second axis runs down, the third back."""
    image = vtk.vtkImageData()
    image.SetExtent(2, 12, -1, 10, 0, 12)
    image.SetSpacing(0.5, 0.75, 2)
    image.SetOrigin(-7, 8, 9)
    image.SetDirectionMatrix(1, 0, 0, 0, 0, 1, 0, -1, 0)
    image.AllocateScalars(getattr(vtk, "VTK_" + number_type.upper()), 1)
    for z in range(0, 13):
        for y in range(-1, 11):
            for x in range(2, 13):
                image.SetScalarComponentFromDouble(x, y, z, 0, x - 2 + 10 * (y + 1) + 100 * z)
    writer = vtk.vtkXMLImageDataWriter()
    writer.SetInputData(image)
    return writer


def write(file, mode, compressor, header, order, number_type):
    writer = image_writer(number_type) if file.endswith(".vti") else sphere_writer()
    writer.SetFileName(file)
    {"little": writer.SetByteOrderToLittleEndian, "big": writer.SetByteOrderToBigEndian}[order]()
    {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary}.get(
        mode, writer.SetDataModeToAppended)()
    writer.SetEncodeAppendedData(mode != "raw")
    writer.SetBlockSize(4096)  # several blocks an array
    {"none": writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib}[compressor]()
    {"32": writer.SetHeaderTypeToUInt32, "64": writer.SetHeaderTypeToUInt64}[header]()
    sys.exit(0 if writer.Write() else 1)


def write_legacy(file, mode, version=""):
    source = sphere()
    heights = vtk.vtkElevationFilter()
    heights.SetInputConnection(source.GetOutputPort())
    writer = {"vtk": vtk.vtkPolyDataWriter, "ply": vtk.vtkPLYWriter, "obj": vtk.vtkOBJWriter}[file[-3:]]()
    writer.SetInputConnection(heights.GetOutputPort())
    writer.SetFileName(file)
    if not file.endswith("obj"):
        {"ascii": writer.SetFileTypeToASCII, "binary": writer.SetFileTypeToBinary}[mode]()
    if version:
        writer.SetFileVersion(int(version))
    sys.exit(0 if writer.Write() else 1)


{"describe": describe, "write": write, "write_legacy": write_legacy}[sys.argv[1]](*sys.argv[2:])
