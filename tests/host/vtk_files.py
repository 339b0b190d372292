"""What VTK makes of our files, and files by VTK for us to read; run by vtk_files_test.

vtk_files.py describe FILE                          prints JSON
vtk_files.py write FILE ascii|binary|appended|raw none|zlib 32|64
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


def write(file, mode, compressor, header):
    sphere = vtk.vtkSphereSource()
    sphere.SetThetaResolution(80)
    sphere.SetPhiResolution(40)
    sphere.SetRadius(10)
    writer = vtk.vtkXMLPolyDataWriter()
    writer.SetInputConnection(sphere.GetOutputPort())
    writer.SetFileName(file)
    {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary}.get(
        mode, writer.SetDataModeToAppended)()
    writer.SetEncodeAppendedData(mode != "raw")
    writer.SetBlockSize(4096)  # several blocks an array
    {"none": writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib}[compressor]()
    {"32": writer.SetHeaderTypeToUInt32, "64": writer.SetHeaderTypeToUInt64}[header]()
    sys.exit(0 if writer.Write() else 1)


{"describe": describe, "write": write}[sys.argv[1]](*sys.argv[2:])
