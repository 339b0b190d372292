#pragma once

#include "xraycast/base/progress.hpp"
#include "xraycast/volume/volume.hpp"

#include <cstdint>
#include <filesystem>
#include <span>

namespace xraycast {

/// Writes a volume as NRRD (`.nrrd`), NIfTI (`.nii`, `.nii.gz`) or MetaImage (`.mha`, `.mhd`), by the
/// extension. Throws InputError for another extension and Error when the disk is full.
void write_volume(const Volume& volume, const std::filesystem::path& path, Progress& progress);

/// Throws InputError, naming the supported ones, for an extension that write_volume does not support.
void check_volume_format(const std::filesystem::path& path);

/// A scalar field on a volume's grid, x fastest. Written like a volume, as 32-bit floats.
void write_field(const VolumeGeometry& geometry, std::span<const float> field,
                 const std::filesystem::path& path, Progress& progress);

/// Fractions on a volume's grid, 255 for 1, x fastest. Written as 32-bit floats from 0 to 1, as NRRD with
/// gzipped voxels, because most are 0. The path must end in `.nrrd`.
void write_fractions(const VolumeGeometry& geometry, std::span<const std::uint8_t> fractions,
                     const std::filesystem::path& path);

/// A mask on a volume's grid: 1 inside, 0 outside, x fastest. Written like a volume, one byte per voxel.
void write_mask(const VolumeGeometry& geometry, std::span<const std::uint8_t> mask,
                const std::filesystem::path& path);

}  // namespace xraycast
