#include "fuzz/readers.hpp"

#include "support/hdf5_transform.hpp"
#include "support/igtlink_bytes.hpp"
#include "support/read_scan.hpp"
#include "support/scan_files.hpp"
#include "xraycast/attenuation/opacity.hpp"
#include "xraycast/attenuation/spectrum.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/blood_flow/heart_waveform.hpp"
#include "xraycast/casting/basis_file.hpp"
#include "xraycast/casting/body_map.hpp"
#include "xraycast/casting/key_maps.hpp"
#include "xraycast/centrelines/tree_of_lines.hpp"
#include "xraycast/contrast_agent/injection.hpp"
#include "xraycast/fluoroscope/c_arm.hpp"
#include "xraycast/geometry/curved_axis.hpp"
#include "xraycast/geometry/mesh.hpp"
#include "xraycast/geometry/vessel_tree.hpp"
#include "xraycast/mechanics/instrument_model.hpp"
#include "xraycast/motion/motion.hpp"
#include "xraycast/network/igtlink_receiver.hpp"
#include "xraycast/scene/session_file.hpp"
#include "xraycast/simulation/script.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <random>
#include <stdexcept>
#include <string_view>
#include <zlib.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;
using Content = Reader::Content;

// ---- whole files ------------------------------------------------------------------------------------

constexpr int kColumns = 8, kRows = 6, kSlices = 4;

/// No two voxels in a row the same.
Volume volume() {
  Volume volume({{kColumns, kRows, kSlices}, {1, 1.5, 2}, {-8, -9, 3}});
  std::mt19937 random(7);
  for (std::int16_t& hu : volume.hu()) hu = static_cast<std::int16_t>(random() % 2000) - 1000;
  return volume;
}

std::string voxels() { return bytes_of(std::span<const std::int16_t>(volume().hu())); }

void write_scan(const fs::path& path) {
  Progress progress;
  write_volume(volume(), path, progress);
}

constexpr char kNrrdHeader[] =
    "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 8 6 4\n"
    "space directions: (1,0,0) (0,1.5,0) (0,0,2)\nencoding: gzip\nendian: little\nspace origin: "
    "(-8,-9,3)\n\n";
/// With every field of a volume in the patient's space, or of one in none.
constexpr char kNrrdFields[] =
    "NRRD0005\n# as 3D Slicer writes it\ntype: short\ndimension: 4\nspace: left-anterior-superior\nsizes: 1 "
    "8 6 4\n"
    "space directions: none (1,0,0) (0,-1.5,0) (0,0,2)\nkinds: list domain domain domain\nencoding: raw\n"
    "endian: little\nlabels: \"frame\" \"\" \"\" \"\"\nthicknesses: nan 1 1 2\ncontent: a scan\nbyte skip: "
    "0\n"
    "space units: \"mm\" \"mm\" \"mm\"\nspace origin: (-8,9,3)\nSegment0_Name:=aorta: ascending\n"
    "measurement frame: (1,0,0) (0,1,0) (0,0,1)\n\n";
constexpr char kNrrdFieldsWithoutSpace[] =
    "NRRD0001\ntype: short\ndimension: 3\nsizes: 8 6 4\nspacings: 1 1.5 2\naxis mins: -8.5 -9.75 2\n"
    "axis maxs: -0.5 -0.75 10\ncenterings: cell cell cell\nunits: \"mm\" \"mm\" \"mm\"\nencoding: raw\n"
    "endian: little\nbyte skip: -1\n\n";
constexpr char kMetaImageHeader[] =
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = "
    "True\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -8 -9 3\nElementSpacing = 1 1.5 2\nDimSize = 8 6 4\n"
    "ElementType = MET_SHORT\nElementDataFile = LOCAL\n";

void write_packed_nrrd(const fs::path& path) { write_bytes(path, kNrrdHeader + gzipped(voxels())); }
void write_nrrd_fields(const fs::path& path) { write_bytes(path, kNrrdFields + voxels()); }
void write_nrrd_without_space(const fs::path& path) { write_bytes(path, kNrrdFieldsWithoutSpace + voxels()); }
void write_packed_meta_image(const fs::path& path) {
  write_bytes(path, kMetaImageHeader + deflated(voxels()));
}

NiftiFile nifti() {
  NiftiFile file;
  file.dim = {3, kColumns, kRows, kSlices, 1, 1, 1, 1};
  file.pixdim = {1, 1, 1.5, 2, 1, 1, 1, 1};
  file.voxels = voxels();
  return file;
}

void write_nifti2(const fs::path& path) { write_bytes(path, nifti().bytes2()); }

/// Either of both files.
void write_nifti_pair(const fs::path& path) {
  write_bytes(fs::path(path).replace_extension(".hdr"), nifti().pair_header());
  write_bytes(fs::path(path).replace_extension(".img"), voxels());
}

/// Up to the voxels, which are appended as they are or packed by zlib.
std::string vti_header(bool is_packed) {
  return fmt::format(
      R"(<VTKFile type="ImageData" byte_order="LittleEndian" header_type="UInt32"{}>
<ImageData WholeExtent="0 7 0 5 0 3" Origin="-8 -9 3" Spacing="1 1.5 2" Direction="1 0 0 0 1 0 0 0 1">
<FieldData><Array type="String" Name="SPACE" NumberOfTuples="1" format="ascii">76 80 83 0</Array></FieldData>
<Piece Extent="0 7 0 5 0 3"><PointData Scalars="ct">
<DataArray type="Int16" Name="ct" format="appended" offset="0"/>
</PointData></Piece></ImageData><AppendedData encoding="raw">_)",
      is_packed ? R"( compressor="vtkZLibDataCompressor")" : "");
}

void write_vti(const fs::path& path) {
  const std::string bytes = voxels();
  write_bytes(path, vti_header(false) + bytes_of(static_cast<std::uint32_t>(bytes.size())) + bytes +
                        "</AppendedData></VTKFile>");
}

/// In two blocks, of which the second is smaller.
void write_packed_vti(const fs::path& path) {
  constexpr std::uint32_t kBlock_B = 256;
  const std::string bytes = voxels(), first = deflated(bytes.substr(0, kBlock_B)),
                    last = deflated(bytes.substr(kBlock_B));
  const std::uint32_t sizes[] = {2, kBlock_B, static_cast<std::uint32_t>(bytes.size()) - kBlock_B,
                                 static_cast<std::uint32_t>(first.size()),
                                 static_cast<std::uint32_t>(last.size())};
  write_bytes(path, vti_header(true) + bytes_of(std::span<const std::uint32_t>(sizes)) + first + last +
                        "</AppendedData></VTKFile>");
}

DicomFile dicom_slice(int z) {
  const Volume all = volume();
  constexpr std::size_t kPixels = std::size_t{kColumns} * kRows;
  DicomFile file(kColumns, kRows, all.hu().subspan(kPixels * static_cast<std::size_t>(z), kPixels));
  return file.position({0, 0, z});
}

/// A slice among three others.
void write_dicom_series(const fs::path& path) {
  fs::create_directories(path.parent_path());
  for (const int z : {0, 1, 3}) dicom_slice(z).write(path.parent_path() / fmt::format("{}.dcm", z));
  dicom_slice(2).write(path);
}

/// In two stacks, with the values that all frames share in the data set.
void write_dicom_frames(const fs::path& path) {
  DicomFile file(kColumns, kRows, volume().hu());
  std::vector<std::string> frames;
  for (int z = 0; z < kSlices; ++z) {
    const std::string position = dicom_element(0x00200032, "DS", fmt::format("0\\0\\{}", z)),
                      content = dicom_element(0x00209056, "SH", z < kSlices - 1 ? "1" : "2");
    frames.push_back(dicom_sequence(0x00209111, {content}) + dicom_sequence(0x00209113, {position}));
  }
  file.text(0x00080016, "UI", "1.2.840.10008.5.1.4.1.1.2.1").text(0x00280008, "IS", std::to_string(kSlices));
  file.erase(0x00200032).sequence(0x52009230, frames).write(path);
}

void write_zip(const fs::path& path) {
  std::map<std::string, std::string> files{{"report.txt", "no slice"}};
  for (const int z : {0, 1, 2}) {
    dicom_slice(z).write(path);
    files.emplace(fmt::format("series/{}.dcm", z), read_bytes(path));
  }
  write_bytes(path, zip_bytes(files));
}

void write_genesis(const fs::path& path) {
  write_bytes(path, genesis_bytes({.columns = kColumns, .rows = kRows},
                                  std::vector<std::uint16_t>(std::size_t{kColumns} * kRows, 1024)));
}

VesselTree tree() {
  std::vector<VesselBranch> branches(3);
  for (int i = 0; i < 4; ++i) branches[0].points.push_back({{0.1 * i, 0.2 * i, 15.0 * i}, 6 - 0.1 * i});
  for (int side = 1; side <= 2; ++side) {
    branches[side].parent = 0;
    branches[side].points.push_back(branches[0].points.back());
    for (int i = 1; i < 3; ++i)
      branches[side].points.push_back({{0.3 + (side == 1 ? 9.0 : -9.0) * i, 0.6, 45 + 12.0 * i}, 3});
  }
  return VesselTree(std::move(branches), "tree");
}

void write_vessel_tree(const fs::path& path) { write_tree(tree(), path); }
void write_surface(const fs::path& path) { write_mesh(tube_mesh(tree(), 3), path); }

/// Of faces that name textures, and one of four corners.
void write_obj_surface(const fs::path& path) {
  const Mesh mesh = tube_mesh(tree(), 3);
  std::string text = "# a tube\nmtllib a.mtl\n";
  for (const glm::vec3& p : mesh.points_mm) text += fmt::format("v {} {} {}\n", p.x, p.y, p.z);
  text += "vt 0 0\nf -1 -2 -3 -4\n";
  for (const auto& [a, b, c] : mesh.triangles) text += fmt::format("f {}/1 {}/1 {}/1\n", a + 1, b + 1, c + 1);
  write_bytes(path, text);
}

/// With colours, and lists of texture coordinates.
template <bool is_text>
void write_ply_surface(const fs::path& path) {
  const Mesh mesh = tube_mesh(tree(), 3);
  std::string bytes = fmt::format(
      "ply\nformat {} 1.0\ncomment a tube\nelement vertex {}\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nelement face {}\nproperty list uchar int vertex_indices\n"
      "property list uchar short texcoord\nend_header\n",
      is_text ? "ascii" : "binary_little_endian", mesh.points_mm.size(), mesh.triangles.size());
  for (const glm::vec3& p : mesh.points_mm)
    bytes += is_text ? fmt::format("{} {} {} 255\n", p.x, p.y, p.z) : bytes_of(p) + '\xff';
  for (const auto& t : mesh.triangles)
    bytes += is_text ? fmt::format("3 {} {} {} 1 7\n", t[0], t[1], t[2])
                     : '\3' + bytes_of(t) + '\1' + bytes_of(std::int16_t{7});
  write_bytes(path, bytes);
}

/// With attributes, metadata and texts, as VTK 9 writes them.
void write_vtk_surface(const fs::path& path) {
  write_bytes(
      path,
      "# vtk DataFile Version 5.1\nvtk output\nASCII\nDATASET POLYDATA\nFIELD FieldData 1\n"
      "SPACE 1 1 string\nRAS\n\nPOINTS 4 float\n0 0 0 1 0 0 0 2 0\n0 0 3\nMETADATA\nINFORMATION 0\n\n"
      "POLYGONS 3 6\nOFFSETS vtktypeint64\n0 3 6\nCONNECTIVITY vtktypeint64\n0 2 1 0 1 3\n"
      "TRIANGLE_STRIPS 1 5\n4 0 1 2 3\nCELL_DATA 3\nFIELD FieldData 1\nGroup%20Ids 1 3 int\n3 1 2\n"
      "POINT_DATA 4\nSCALARS r float 1\nLOOKUP_TABLE default\n1 2 3 4\nNORMALS N float\n"
      "0 0 1 0 0 1 0 0 1 0 0 1\nFIELD FieldData 2\nbits 1 4 bit\n0 1 0 1\nnames 1 4 string\na\nb\nc\nd\n");
}

/// A number as VTK stores it.
template <typename T>
std::string big_endian(T value) {
  std::string bytes = bytes_of(value);
  std::ranges::reverse(bytes);
  return bytes;
}

void write_binary_vtk_surface(const fs::path& path) {
  const Mesh mesh = tube_mesh(tree(), 3);
  std::string bytes =
      fmt::format("# vtk DataFile Version 4.2\nSPACE=LPS\nBINARY\nDATASET POLYDATA\nPOINTS {} float\n",
                  mesh.points_mm.size());
  for (const glm::vec3& p : mesh.points_mm) bytes += big_endian(p.x) + big_endian(p.y) + big_endian(p.z);
  bytes += fmt::format("\nPOLYGONS {} {}\n", mesh.triangles.size(), 4 * mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles)
    for (const std::uint32_t index : {std::uint32_t{3}, a, b, c}) bytes += big_endian(index);
  bytes += fmt::format(
      "\nPOINT_DATA {}\nFIELD FieldData 2\nnames 1 2 string\n\xc1"
      "a\xc2"
      "bc\nr 1 {} double\n",
      mesh.points_mm.size(), mesh.points_mm.size());
  for (std::size_t i = 0; i < mesh.points_mm.size(); ++i) bytes += big_endian(0.5);
  write_bytes(path, bytes + "\n");
}

void write_swc(const fs::path& path) {
  write_bytes(path,
              "# a tree\n1 2 0 0 0 3 -1\n2 2 0 0 10 2.5 1\n3 2 0 0 20 2 2\n4 2 5 0 30 1 3\n5 2 9 0 40 1 4\n"
              "6 2 -5 0 30 1 3\n");
}

void write_centreline_csv(const fs::path& path) {
  write_bytes(path,
              "branch,x_mm,y_mm,z_mm,radius\na,0,0,0,3\na,0,0,10,2\na,5,0,20,2\nb,0,0,0,3\nb,0,0,10,2\n"
              "\"b\",-5,0,20,2\n");
}

void write_markups(const fs::path& path) {
  write_bytes(path, R"({"@schema": "v1.0.3", "markups": [
{"type": "Curve", "name": "a", "coordinateSystem": "RAS", "coordinateUnits": "mm",
 "controlPoints": [{"position": [0, 0, 0]}, {"position": [0, 0, 9], "positionStatus": "defined"}, {"position": [1, 0, 20]}],
 "measurements": [{"name": "length"}, {"name": "radius", "controlPointValues": [3, 2, 1.5]}]},
{"type": "ClosedCurve", "coordinateUnits": ["mm", "UCUM", "millimeter"],
 "controlPoints": [{"position": [0, 0, 9]}, {"position": [9, 0, 9]}, {"position": [9, 9, 9]}],
 "measurements": [{"name": "radius", "controlPointValues": [2, 2, 1]}]}]})");
}

/// In tracts, as VMTK leaves them.
void write_centreline_vtk(const fs::path& path) {
  write_bytes(
      path,
      "# vtk DataFile Version 3.0\nSPACE=LPS\nASCII\nDATASET POLYDATA\nPOINTS 6 float\n0 0 0 0 0 10 0 0 10\n"
      "0 0 20 0 0 10 8 0 20\nLINES 4 12\n2 0 1\n2 2 3\n2 0 1\n2 4 5\nCELL_DATA 4\nFIELD f 2\n"
      "CenterlineIds 1 4 int\n0 0 1 1\nTractIds 1 4 int\n0 1 0 1\nPOINT_DATA 6\n"
      "SCALARS MaximumInscribedSphereRadius float\nLOOKUP_TABLE default\n3 2 2 1 2 1\n");
}

MapGeometry map_geometry() { return cylinder_map(volume().geometry(), 16, {0, 10}, {-4, -5}); }

/// Shells that are not round.
MapGeometry map_geometry_with_outline() {
  std::vector<float> outline_mm;
  for (int i = 0; i < map_geometry().width; ++i) outline_mm.push_back(10 - 0.25f * static_cast<float>(i));
  return with_outline(map_geometry(), outline_mm);
}

template <auto Geometry>
void write_small_basis(const fs::path& path) {
  Basis basis;
  basis.geometry = Geometry();
  basis.knots_hu = {-1000, 0, 1000};
  basis.hu_histogram.assign(256, 1);
  basis.touched.assign(static_cast<std::size_t>(tile_count(basis.geometry)), 5);
  basis.weights.assign(basis.touched.size() * 2 * Basis::kTileSlices, 77);
  write_basis(basis, path);
}

template <auto Geometry, MapPrecision Precision = MapPrecision::float32>
void write_map(const fs::path& path) {
  BodyMap map;
  map.geometry = Geometry();
  map.precision = Precision;
  map.tau.assign(static_cast<std::size_t>(map.layer_size()), 0.5f);
  write_body_map(map, path);
}

KeyPhases key_phases_of_readers() {
  const auto moves = affine_displacement(glm::dmat3(1), {0, 0, 12});
  return {
      Motion({{"breath", 4, {}, {{0, nullptr}, {1, moves}}}, {"heart", 1, {}, {{0, nullptr}, {0.4, moves}}}},
             "motion.json"),
      {{0, 1}, {0, 0.4}}};
}

/// The rows of a key: the heart moves none, and the last key the upper ones.
KeyRows key_rows(int key, int height) {
  return {key_phases_of_readers().base_of(key), 0,
          key % 2 == 0 ? height
          : key == 1   ? 0
                       : std::min(16, height)};
}

void write_key_maps(const fs::path& path) {
  const MapGeometry geometry = map_geometry_with_outline();
  std::vector<KeyValues> values;
  for (int key = 0; key < 4; ++key) {
    KeyValues& one = values.emplace_back(KeyValues{key_rows(key, geometry.height), {}});
    one.channels.emplace_back(static_cast<std::size_t>(geometry.layers()) * geometry.width * one.rows.count,
                              0.25f * static_cast<float>(key + 1));
  }
  BodyMap map;
  map.geometry = geometry;
  auto keys = std::make_shared<KeyMaps>(key_phases_of_readers(), geometry, values);
  keys->motion = path.parent_path() / "motion.json";
  write_body_map(moving_map(std::move(map), std::move(keys)), path);
}

void write_key_basis(const fs::path& path) {
  write_small_basis<map_geometry_with_outline>(path);
  Basis basis = read_basis(path);
  auto keys = std::make_shared<BasisKeys>(BasisKeys{key_phases_of_readers(), {}, {}});
  for (int key = 1; key < 4; ++key) {
    const KeyRows rows = key_rows(key, basis.geometry.height);
    keys->others.push_back({rows, {}, {}});
    if (rows.count > 0) keys->others.back() = {rows, basis.touched, basis.weights};
  }
  basis.keys = std::move(keys);
  write_basis(basis, path);
}

void write_spectrum_map(const fs::path& path) {
  BodyMap map;
  map.geometry = map_geometry();
  map.attenuation = Spectrum::named("80");
  for (auto& depths : map.depths) depths.assign(static_cast<std::size_t>(map.layer_size()), 0.5f);
  write_body_map(map, path);
}

/// Of 2 x 3 x 2 nodes.
VectorImage field() {
  VectorImage image{{{2, 3, 2}, {-8, -9, 3}, {{4, 1, 0}, {-1, 4, 0}, {0, 0, 5}}}, {}};
  std::mt19937 random(9);
  for (int n = 0; n < 12; ++n)
    image.vectors.emplace_back(random() % 9, static_cast<float>(random() % 9) - 4.5F, 0.25F);
  return image;
}

void write_field_of_vectors(const fs::path& path) { write_vector_image(field(), path); }

std::string field_bytes() {
  const VectorImage image = field();
  return {reinterpret_cast<const char*>(image.vectors.data()),
          image.vectors.size() * sizeof image.vectors[0]};
}

void write_meta_image_field(const fs::path& path) {
  write_bytes(
      path,
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
      "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -8 -9 3\nElementSpacing = 4 4 5\nDimSize = 2 3 2\n"
      "ElementNumberOfChannels = 3\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n" +
          field_bytes());
}

/// Of five dimensions.
void write_nifti_field(const fs::path& path) {
  NiftiFile file;
  file.dim = {5, 2, 3, 2, 1, 3, 1, 1};
  file.datatype = 16, file.bitpix = 32;
  file.voxels = field_bytes();
  write_bytes(path, file.bytes());
}

/// A composite of a matrix and a spline.
void write_transform_text(const fs::path& path) {
  std::string coefficients;
  for (int n = 0; n < 3 * 64; ++n) coefficients += fmt::format("{} ", 0.25 * (n % 7));
  write_bytes(path,
              "#Insight Transform File V1.0\n#Transform 0\nTransform: CompositeTransform_double_3_3\n"
              "#Transform 1\nTransform: AffineTransform_double_3_3\n"
              "Parameters: 1 0.1 0 0 0.9 0.05 0.02 0 1.1 1 2 3\nFixedParameters: 10 20 30\n"
              "#Transform 2\nTransform: BSplineTransform_double_3_3\nParameters: " +
                  coefficients + "\nFixedParameters: 4 4 4 -10 -10 -10 9 9 9 1 0 0 0 1 0 0 0 1\n");
}

void write_transform_matlab(const fs::path& path) {
  const auto matrix = [](const std::string& name, const std::vector<double>& values) {
    const std::int32_t header[] = {0, static_cast<std::int32_t>(values.size()), 1, 0,
                                   static_cast<std::int32_t>(name.size()) + 1};
    return bytes_of(std::span<const std::int32_t>(header)) + name + '\0' +
           bytes_of(std::span<const double>(values));
  };
  write_bytes(path, matrix("AffineTransform_double_3_3", {1, 0.1, 0, 0, 0.9, 0.05, 0.02, 0, 1.1, 1, 2, 3}) +
                        matrix("fixed", {10, 20, 30}));
}

/// With a field and a composition, and both ways of time.
void write_motion(const fs::path& path) {
  write_field_of_vectors(path.parent_path() / "f.nrrd");
  write_transform_text(path.parent_path() / "t.tfm");
  write_bytes(path, R"({"version": 1, "modes": [
  {"name": "breath", "period_s": 4, "phases": [{"phase": 0}, {"phase": 1, "field": "f.nrrd"}]},
  {"name": "heart", "waveform": [[0, 0], [0.8, 1], [1.7, 2]], "comment": "at rest",
   "phases": [{"phase": 0}, {"phase": 0.35, "field": ["f.nrrd", "t.tfm"]}]}]})");
}

/// Of everything that a session may hold.
void write_whole_session(const fs::path& path) {
  ViewSession session;
  for (const auto& [file, name] : {std::pair{&session.map, "map.exr"}, {&session.basis, "ct.basis"}}) {
    *file = path.parent_path() / name;
    write_bytes(*file, "");
  }
  session.steered = {{{{{1, 2, 3}, {4.25, 5, 6}}, 0.825, true}}, false};
  session.pose.cone = Cone{900, 1200};
  session.style.sampling.wall_radius_mm = 100;
  session.style.layer_weights = {1, 0.5};
  session.has_window = true;
  session.opacity = Opacity::bilinear();
  write_session(session, path);
}

void write_messages(const fs::path& path) {
  // The first byte says in what portions the others arrive.
  write_bytes(path, '\x20' + transform_message(20, 1) + MessageBytes{.type = "GET_STATUS"}.bytes() +
                        transform_message(30, -3) + request_message("STT_IMAGE", 40) +
                        c_arm_message(1, 0.5, 20) + string_message("Pedal", "down") +
                        string_message("Contrast", "3 ml/s") +
                        MessageBytes{.type = "COLORT", .body = "text"}.bytes());
}

// ---- reading ----------------------------------------------------------------------------------------

Content read_as_scan(const fs::path& path) {
  const Volume read = read_scan(path).volume;
  return bytes_of(std::span<const std::int16_t>(read.hu()));
}

Content read_as_nifti_pair(const fs::path& path) {
  return read_as_scan(fs::path(path).replace_extension(".hdr"));
}

Content read_as_basis(const fs::path& path) {
  const Basis read = read_basis(path);
  return bytes_of(std::span(read.geometry.outline_mm)) + bytes_of(std::span(read.touched)) +
         bytes_of(std::span(read.weights));
}

void check_pose(const HubPose& pose, double before_rad) {
  constexpr double kHalfTurn = 3.15;  // as floats have it
  if (!(std::abs(pose.insertion_mm) <= IgtlinkReceiver::kMaxInsertion_mm))
    throw std::logic_error("an insertion out of range");
  if (!(std::abs(pose.rotation_rad - before_rad) <= kHalfTurn))
    throw std::logic_error("a rotation of more than half a turn");
}

void check_command(const IgtlinkReceiver::Event& event) {
  const auto expect = [](bool is_so, const char* what) {
    if (!is_so) throw std::logic_error(what);
  };
  if (const auto* move = std::get_if<CArmMove>(&event)) {
    expect(std::abs(move->pose.lao_rad) <= 3.15 && std::abs(move->pose.cranial_rad) <= 1.6,
           "angles out of range");
    expect(std::abs(move->pose.centre_mm.z) <= IgtlinkReceiver::kMaxPosition_mm, "an isocentre out of range");
  } else if (const auto* rate = std::get_if<ContrastRate>(&event)) {
    expect(rate->ml_s >= 0 && rate->ml_s <= kMaxInjection_ml_s, "an injection out of range");
  } else if (const auto* pressure = std::get_if<BalloonPressure>(&event)) {
    expect(
        pressure->hub < kMaxHubs && pressure->bar >= 0 && pressure->bar <= IgtlinkReceiver::kMaxBalloon_bar,
        "a pressure out of range");
  } else if (const auto* drawn = std::get_if<SheathDrawn>(&event)) {
    expect(drawn->hub < kMaxHubs && drawn->mm >= 0 && drawn->mm <= IgtlinkReceiver::kMaxInsertion_mm,
           "a sheath out of range");
  } else if (const auto* request = std::get_if<StreamRequest>(&event)) {
    expect(
        request->interval >= request->interval.zero() && request->interval <= IgtlinkReceiver::kMaxInterval,
        "an interval out of range");
    expect(request->type.size() <= 8 && request->name.size() <= 20, "names longer than they were sent");
  }
}

/// Refuses the whole stream for one message's sake.
Content read_messages(const fs::path& path) {
  const std::string stream = read_bytes(path);
  const auto portion_B = static_cast<unsigned char>(stream.empty() ? 0 : stream[0]);
  auto bytes = std::as_bytes(std::span(stream)).subspan(stream.empty() ? 0 : 1);
  IgtlinkReceiver receiver(kMaxHubs);
  std::optional<Complaint> first;
  IgtlinkReceiver::Rotations rotations_rad{};
  while (!bytes.empty()) {
    auto portion = bytes.first(std::min<std::size_t>(portion_B > 0 ? portion_B : bytes.size(), bytes.size()));
    bytes = bytes.subspan(portion.size());
    while (const auto event = receiver.next(portion)) {
      if (const auto* move = std::get_if<HubMove>(&*event)) {
        check_pose(move->pose, rotations_rad.at(move->hub));
        rotations_rad[move->hub] = move->pose.rotation_rad;
      } else if (const auto* complaint = std::get_if<Complaint>(&*event)) {
        if (!std::ranges::all_of(complaint->text, [](char c) { return c >= ' ' && c <= '~'; }))
          throw std::logic_error("a complaint that cannot be printed");
        if (!first && complaint->text.find("COLORT") == std::string::npos) first = *complaint;
      } else {
        check_command(*event);
      }
    }
    if (!portion.empty()) throw std::logic_error("bytes were left over");
  }
  if (!first) first = receiver.end();
  if (first) throw InputError("{}: {}", path.string(), first->text);
  return {};
}

/// Blends what was read too.
Content read_as_key_maps(const fs::path& path) {
  const BodyMap map = read_body_map(path);
  if (!map.keys) return {};
  for (const double time_s : {0.0, 0.7, 5.5})
    for (const float value : map_at(map, map.keys->phases().rhythm().phases_at(time_s)).tau)
      if (!std::isfinite(value)) throw std::logic_error("a blended value that is no number");
  return {};
}

/// Looks at places around the fields too: none may be anything but a number.
Content read_as_motion(const fs::path& path) {
  const Motion motion = read_motion(path);
  for (const double time_s : {0.0, 0.7, 5.5}) {
    const HeldMotion held = motion.held_at(motion.phases_at(time_s));
    for (const double mm : {-50.0, 0.0, 3.0, 1e4})
      if (const glm::dvec3 d_mm = held.displacement_mm(glm::dvec3(mm));
          !std::isfinite(d_mm.x + d_mm.y + d_mm.z))
        throw std::logic_error("a displacement that is no number");
  }
  return {};
}

Content read_as_field(const fs::path& path) {
  if (!std::isfinite(read_displacement(path)->at({1, 2, 3}).x))
    throw std::logic_error("a displacement that is no number");
  return {};
}

/// Makes a tree of them too.
Content read_as_tree_of_lines(const fs::path& path) {
  tree_of_lines(read_centreline_lines(path), path.string());
  return {};
}

/// For as many devices as it seems to have columns of.
Script read_script(const fs::path& path) {
  const std::string text = read_bytes(path);
  const auto has = [&](const char* column) { return text.find(column) != std::string::npos; };
  return Script::read(path, has("insertion_3_mm") ? 3 : has("insertion_2_mm") ? 2 : 1);
}

// ---- checksums --------------------------------------------------------------------------------------

void set_message_checksums(std::span<char> bytes) {
  igtl_header header;
  for (auto rest = bytes.subspan(std::min<std::size_t>(bytes.size(), 1)); rest.size() >= sizeof header;) {
    std::memcpy(&header, rest.data(), sizeof header);
    igtl_header_convert_byte_order(&header);
    const std::uint64_t body_B = header.body_size;
    if (body_B > rest.size() - sizeof header) return;
    header.crc = crc64(reinterpret_cast<unsigned char*>(rest.data()) + sizeof header, body_B, 0);
    igtl_header_convert_byte_order(&header);
    std::memcpy(rest.data(), &header, sizeof header);
    rest = rest.subspan(sizeof header + body_B);
  }
}

/// Of chunks: a tag of four bytes, a size of eight, so many bytes, and a CRC-32 of all that.
void set_basis_checksums(std::span<char> bytes) {
  constexpr std::size_t kStart_B = 12, kHead_B = 12, kChecksum_B = 4;
  for (auto rest = bytes.subspan(std::min(bytes.size(), kStart_B)); rest.size() >= kHead_B + kChecksum_B;) {
    std::uint64_t size_B = 0;
    std::memcpy(&size_B, rest.data() + 4, sizeof size_B);
    if (size_B > rest.size() - kHead_B - kChecksum_B) return;
    const auto* summed = reinterpret_cast<const Bytef*>(rest.data());
    const auto checksum = static_cast<std::uint32_t>(crc32(0, summed, static_cast<uInt>(kHead_B + size_B)));
    std::memcpy(rest.data() + kHead_B + size_B, &checksum, sizeof checksum);
    rest = rest.subspan(kHead_B + size_B + kChecksum_B);
  }
}

// ---- all of them ------------------------------------------------------------------------------------

/// A reader that gives nothing to compare.
template <auto Read>
Content without_content(const fs::path& path) {
  Read(path);
  return {};
}

const Reader kReaders[] = {
    {"nifti", "a.nii", write_scan, read_as_scan},
    {"nifti_gzipped", "a.nii.gz", write_scan, read_as_scan, 0},
    {"nifti2", "a.nii", write_nifti2, read_as_scan},
    {"nifti_pair_header", "a.hdr", write_nifti_pair, read_as_nifti_pair},
    {"nifti_pair_voxels", "a.img", write_nifti_pair, read_as_nifti_pair},
    {"nrrd", "a.nrrd", write_scan, read_as_scan},
    {"nrrd_gzipped", "a.nrrd", write_packed_nrrd, read_as_scan, sizeof kNrrdHeader - 1},
    {"nrrd_gzipped_header", "a.nrrd", write_packed_nrrd, read_as_scan},
    {"nrrd_fields", "a.nrrd", write_nrrd_fields, read_as_scan},
    {"nrrd_without_space", "a.nrrd", write_nrrd_without_space, read_as_scan},
    {"meta_image", "a.mha", write_scan, read_as_scan},
    {"meta_image_of_two_files", "a.mhd", write_scan, read_as_scan},
    {"meta_image_packed", "a.mha", write_packed_meta_image, read_as_scan, sizeof kMetaImageHeader - 1},
    {"meta_image_packed_header", "a.mha", write_packed_meta_image, read_as_scan},
    {"vti", "a.vti", write_vti, read_as_scan},
    {"vti_packed", "a.vti", write_packed_vti, read_as_scan, vti_header(true).size()},
    {"vti_packed_header", "a.vti", write_packed_vti, read_as_scan},
    {"dicom", "a.dcm", [](const fs::path& path) { dicom_slice(0).write(path); }, read_as_scan},
    {"dicom_implicit", "a.dcm",
     [](const fs::path& path) { dicom_slice(0).write(path, DicomFile::Syntax::implicit_little); },
     read_as_scan},
    {"dicom_deflated", "a.dcm",
     [](const fs::path& path) { dicom_slice(0).write(path, DicomFile::Syntax::deflated); }, read_as_scan},
    {"dicom_big_endian", "a.dcm",
     [](const fs::path& path) { dicom_slice(0).write(path, DicomFile::Syntax::explicit_big); }, read_as_scan},
    {"dicom_frames", "a.dcm", write_dicom_frames, read_as_scan},
    {"dicom_series", "series/2.dcm", write_dicom_series,
     [](const fs::path& path) { return read_as_scan(path.parent_path()); }},
    {"zip", "a.zip", write_zip, read_as_scan},
    {"genesis", "a.fro", write_genesis, read_as_scan},
    {"map", "map.exr", write_map<map_geometry>, without_content<read_body_map>},
    {"map_outline", "map.exr", write_map<map_geometry_with_outline>, without_content<read_body_map>},
    {"map_bytes", "map.exr", write_map<map_geometry_with_outline, MapPrecision::byte>,
     without_content<read_body_map>},
    {"spectrum_map", "map.exr", write_spectrum_map, without_content<read_body_map>},
    {"basis", "a.basis", write_small_basis<map_geometry>, read_as_basis, 0, set_basis_checksums},
    {"basis_outline", "a.basis", write_small_basis<map_geometry_with_outline>, read_as_basis, 0,
     set_basis_checksums},
    {"key_maps", "map.exr", write_key_maps, read_as_key_maps},
    {"key_basis", "a.basis", write_key_basis, read_as_basis, 0, set_basis_checksums},
    {"tree_vtp", "tree.vtp", write_vessel_tree, without_content<read_tree>},
    {"tree_json", "tree.json", write_vessel_tree, without_content<read_tree>},
    {"surface_vtp", "surface.vtp", write_surface, without_content<read_mesh>},
    {"surface_stl", "surface.stl", write_surface, without_content<read_mesh>},
    {"surface_obj", "surface.obj", write_obj_surface, without_content<read_mesh>},
    {"surface_ply", "surface.ply", write_ply_surface<true>, without_content<read_mesh>},
    {"surface_ply_binary", "surface.ply", write_ply_surface<false>, without_content<read_mesh>},
    {"surface_vtk", "surface.vtk", write_vtk_surface, without_content<read_mesh>},
    {"surface_vtk_binary", "surface.vtk", write_binary_vtk_surface, without_content<read_mesh>},
    {"centrelines_swc", "a.swc", write_swc, read_as_tree_of_lines},
    {"centrelines_csv", "a.csv", write_centreline_csv, read_as_tree_of_lines},
    {"centrelines_markups", "a.mrk.json", write_markups, read_as_tree_of_lines},
    {"centrelines_vtk", "a.vtk", write_centreline_vtk, read_as_tree_of_lines},
    {"opacity", "opacity.json",
     [](const fs::path& path) { write_bytes(path, Opacity::bilinear().to_json()); },
     [](const fs::path& path) { return Opacity::named(path.string()), Content(); }},
    {"instrument", "instrument.json",
     [](const fs::path& path) {
       fs::copy_file(fs::path(XRAYCAST_SOURCE_DIR) / "simulation/instruments/cobra-5f.json", path);
     },
     [](const fs::path& path) { return InstrumentModel::named(path.string()), Content(); }},
    {"c_arm", "c-arm.json",
     [](const fs::path& path) {
       fs::copy_file(fs::path(XRAYCAST_SOURCE_DIR) / "viewer/c_arms/mobile-intensifier.json", path);
     },
     [](const fs::path& path) { return CArm::named(path.string()), Content(); }},
    {"spectrum", "beam.txt",
     [](const fs::path& path) { write_bytes(path, "# keV, photons\n20 0.5\n40 1\n60 2.25\n80 0.1\n"); },
     [](const fs::path& path) { return Spectrum::named(path.string()), Content(); }},
    {"heart_waveform", "heart.csv",
     [](const fs::path& path) {
       write_bytes(path, "time_s,flow_ml_s\n0,0\n0.1,420\n0.3,-20\n0.35,0\n0.86,0\n");
     },
     without_content<HeartWaveform::read>},
    {"script", "push.csv",
     [](const fs::path& path) {
       write_bytes(path, "time_s,insertion_mm,rotation_deg\n0,0,0\n1,20,180\n4,300,180\n");
     },
     without_content<read_script>},
    {"centre_line", "line.csv",
     [](const fs::path& path) { write_bytes(path, "x,y,z\n0,0,0\n1,2,3\n-1.5,2,30\n"); },
     [](const fs::path& path) { return CurvedAxis::from_file(path.string()), Content(); }},
    {"session", "session.json", write_whole_session, without_content<read_session>},
    {"motion", "motion.json", write_motion, read_as_motion},
    {"field_nrrd", "f.nrrd", write_field_of_vectors, read_as_field},
    {"field_meta_image", "f.mha", write_meta_image_field, read_as_field},
    {"field_nifti", "f.nii", write_nifti_field, read_as_field},
    {"transform_text", "t.tfm", write_transform_text, read_as_field},
    {"transform_matlab", "t.mat", write_transform_matlab, read_as_field},
    {"transform_hdf5", "t.h5",
     [](const fs::path& path) {
       write_hdf5_transform(path, "AffineTransform_double_3_3",
                            {1, 0.1, 0, 0, 0.9, 0.05, 0.02, 0, 1.1, 1, 2, 3}, {10, 20, 30});
     },
     read_as_field},
    {"igtlink", "messages", write_messages, read_messages, {}, set_message_checksums},
};

constexpr std::size_t kMostMessage_B = 500;

/// What follows a semicolon, or what must be; `message` is what stands behind the file's name.
bool says_what_to_do(std::string_view message) {
  return message.find("; ") != std::string_view::npos || message.find(" must ") != std::string_view::npos;
}

}  // namespace

std::span<const Reader> readers() { return kReaders; }

FileToRead::FileToRead(const Reader& reader, const fs::path& folder)
    : reader_(reader), path_(folder / reader.file) {
  reader.write(path_);
  whole_ = read_bytes(path_);
}

std::optional<Content> FileToRead::read(const std::string& bytes) const {
  write_bytes(path_, bytes);
  try {
    return reader_.read(path_);
  } catch (const InputError& error) {
    std::string_view message = error.what();
    if (message.find_first_of("\n\r\x1b") != std::string_view::npos)
      throw std::logic_error(std::string("not one line, fit for a terminal: ") + error.what());
    if (message.size() > kMostMessage_B)
      throw std::logic_error(std::string("not a short line: ") + error.what());
    // A series is named by its folder, the voxels' file by its own name.
    if (!message.starts_with(path_.parent_path().string()))
      throw std::logic_error(std::string("not the file's name first: ") + error.what());
    // Another file's name than this one's is one of the reader's own, without a semicolon.
    const std::string name = path_.string(), folder = path_.parent_path().string();
    message.remove_prefix(message.starts_with(name) ? name.size() : folder.size());
    if (reader_.read != read_messages && !says_what_to_do(message))
      throw std::logic_error(std::string("not what to do: ") + error.what());
    return std::nullopt;
  } catch (const std::exception& error) {
    throw std::logic_error(std::string("another exception than an InputError: ") + error.what());
  }
}

}  // namespace xraycast
