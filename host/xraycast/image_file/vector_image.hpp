#pragma once

#include "xraycast/volume/volume.hpp"

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace xraycast {

/// A grid whose axes may be rotated, mirrored or sheared against the patient's.
struct FieldGrid {
  Index3 size{0, 0, 0};
  glm::dvec3 origin_mm{0, 0, 0};  ///< of node (0, 0, 0), LPS
  glm::dmat3 step_mm{1};          ///< in its columns, from a node to the next along each axis

  std::int64_t nodes() const { return size.x * size.y * size.z; }
  glm::dvec3 to_world_mm(const glm::dvec3& node) const { return origin_mm + step_mm * node; }
};

/// Throws InputError, with `name` in front, unless every size is 1 to 65,536, origin and steps are finite and
/// the steps span space.
void validate(const FieldGrid& grid, const std::string& name);

/// Three numbers at each node of a grid, x fastest.
struct VectorImage {
  FieldGrid grid;
  std::vector<glm::vec3> vectors;  ///< in LPS
  std::vector<std::string> warnings{};
};

/// Whether a file's first bytes are those of NRRD, MetaImage or NIfTI.
bool is_image_file(const std::filesystem::path& path);

/// Reads an NRRD or MetaImage file with three numbers per voxel, or a NIfTI of five dimensions, the fourth
/// 1 and the last 3, as ANTs and ITK write them. Vectors are LPS, but for NRRD with a measurement frame and
/// NIfTI of intent 1006 (displacements), which are RAS as in ITK. Throws InputError, naming the file.
VectorImage read_vector_image(const std::filesystem::path& path);

/// Writes NRRD, raw 32-bit floats. The path must end in `.nrrd`. Throws Error when the disk is full.
void write_vector_image(const VectorImage& image, const std::filesystem::path& path);

}  // namespace xraycast
