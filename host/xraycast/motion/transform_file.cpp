#include "xraycast/motion/transform_file.hpp"

#include "xraycast/base/child_process.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/file_extension.hpp"
#include "xraycast/base/loaded_module.hpp"
#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/motion/hdf5_transforms.hpp"

#include <array>
#include <cstring>
#include <fstream>
#include <functional>
#include <span>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTextMagic = "#Insight Transform File", kHdf5Magic = "\x89HDF\r\n\x1a\n";

std::string leading_bytes(const fs::path& path) {
  std::array<char, 64> bytes{};
  std::ifstream stream(path, std::ios::binary);
  stream.read(bytes.data(), std::ssize(bytes));
  return {bytes.data(), static_cast<std::size_t>(stream.gcount())};
}

// ---- text ---------------------------------------------------------------------------------------------

std::vector<double> numbers_in(std::string_view text) {
  std::vector<double> numbers;
  for (text = trimmed(text); !text.empty(); text = trimmed(text)) {
    const std::string_view word = text.substr(0, text.find_first_of(" \t"));
    if (!parse_whole(word, numbers.emplace_back())) throw InputError("'{}' is no number", excerpt(word));
    text.remove_prefix(word.size());
  }
  return numbers;
}

std::vector<StoredTransform> transforms_of_text(const fs::path& path) {
  const std::string content = read_whole_file(path);
  std::vector<StoredTransform> transforms;
  std::string_view left = content;
  while (!left.empty()) {
    const std::string_view line = trimmed(take_line(left));
    if (line.empty() || line.starts_with('#')) continue;
    const auto colon = line.find(':');
    const std::string_view name = line.substr(0, colon);
    const std::string_view value = colon == std::string_view::npos ? "" : line.substr(colon + 1);
    try {
      if (name == "Transform")
        transforms.push_back({std::string(trimmed(value)), {}, {}});
      else if (name == "Parameters" && !transforms.empty())
        transforms.back().parameters = numbers_in(value);
      else if (name == "FixedParameters" && !transforms.empty())
        transforms.back().fixed_parameters = numbers_in(value);
      else
        throw InputError("the line '{}' is none of an ITK transform", excerpt(line));
    } catch (const InputError& error) {
      throw InputError("{}: {}; save the transform again", path.string(), error.what());
    }
  }
  return transforms;
}

// ---- MATLAB -------------------------------------------------------------------------------------------

/// A matrix of MATLAB's level 4, as ANTs writes affine transforms.
struct Matrix {
  std::string name;
  std::vector<double> values;
};

/// Takes the next matrix off the content. Throws InputError without the file's name.
Matrix take_matrix(std::string_view& content) {
  struct {
    std::int32_t type, rows, columns, is_complex, name_B;
  } header{};
  const auto take = [&](void* bytes, std::size_t count) {
    if (content.size() < count) throw InputError("truncated");
    std::memcpy(bytes, content.data(), count);
    content.remove_prefix(count);
  };
  take(&header, sizeof header);
  constexpr std::int32_t kDoubles = 0, kFloats = 10, kMost = 1 << 20;
  if ((header.type != kDoubles && header.type != kFloats) || header.is_complex != 0 || header.rows < 0 ||
      header.rows > kMost || header.columns < 0 || header.columns > 1 || header.name_B < 1 ||
      header.name_B > kMost)
    throw InputError("no MATLAB file of level 4 with one list of numbers per name");
  const std::size_t count = static_cast<std::size_t>(header.rows) * static_cast<std::size_t>(header.columns);
  if (content.size() < static_cast<std::size_t>(header.name_B)) throw InputError("truncated");
  Matrix matrix{std::string(content.substr(0, static_cast<std::size_t>(header.name_B))).c_str(), {}};
  content.remove_prefix(static_cast<std::size_t>(header.name_B));
  const std::size_t number_B = header.type == kDoubles ? sizeof(double) : sizeof(float);
  if (content.size() / number_B < count) throw InputError("truncated");
  matrix.values.resize(count);
  for (double& value : matrix.values)
    if (float narrow = 0; header.type == kFloats) {
      take(&narrow, sizeof narrow);
      value = narrow;
    } else {
      take(&value, sizeof value);
    }
  return matrix;
}

std::vector<StoredTransform> transforms_of_matlab(const fs::path& path) {
  const std::string content = read_whole_file(path);
  return with_remedy(path, "save the transform again", [&] {
    try {
      std::vector<StoredTransform> transforms;
      for (std::string_view left = content; !left.empty();) {
        Matrix matrix = take_matrix(left);
        if (matrix.name == "fixed" && !transforms.empty())
          transforms.back().fixed_parameters = std::move(matrix.values);
        else
          transforms.push_back({std::move(matrix.name), std::move(matrix.values), {}});
      }
      return transforms;
    } catch (const InputError& error) {
      throw InputError("{}: {}", path.string(), error.what());
    }
  });
}

// ---- HDF5 ---------------------------------------------------------------------------------------------

/// Of the library, and what else it loads.
constexpr MemoryNeed kHdf5{100 << 20, 20 << 20};

const Hdf5Transforms& hdf5_module(const fs::path& path) {
  using Get = const Hdf5Transforms* (*)();
  try {
    return *reinterpret_cast<Get>(
        module_function(XRAYCAST_TRANSFORMS_MODULE, "xraycast_transforms", kHdf5))();
  } catch (const Error& error) {
    throw Error("{}: takes HDF5, unlike .tfm: {}", path.string(), error.what());
  }
}

/// Runs the library, which may crash on a damaged file, in a process of its own.
void read_in_child(const fs::path& path, const std::function<void()>& read, std::int64_t memory_B) {
  constexpr std::int64_t kLibrary_B = 200 << 20;
  if (!run_in_child(read, {.memory_B = kLibrary_B + 2 * memory_B}))
    throw InputError("{}: holds no ITK transform, or is damaged; save the transform again", path.string());
}

std::vector<Hdf5Layout> hdf5_layouts(const Hdf5Transforms& module, const fs::path& path) {
  constexpr std::size_t kCount_B = sizeof(std::int64_t);
  const SharedMemory shared(kCount_B + Hdf5Layout::kMostTransforms * sizeof(Hdf5Layout));
  std::byte* const bytes = shared.bytes().data();
  read_in_child(
      path,
      [&] {
        const std::vector<Hdf5Layout> layouts = module.layouts(path.string());
        const std::int64_t count = std::ssize(layouts);
        std::memcpy(bytes, &count, kCount_B);
        std::memcpy(bytes + kCount_B, layouts.data(), layouts.size() * sizeof(Hdf5Layout));
      },
      0);
  std::int64_t count = 0;
  std::memcpy(&count, bytes, kCount_B);
  // What a damaged file made of them counts as untrusted too.
  constexpr std::int64_t kMostNumbers = std::int64_t{1} << 36;
  bool is_usable = count >= 0 && count <= std::int64_t{Hdf5Layout::kMostTransforms};
  std::vector<Hdf5Layout> layouts(is_usable ? static_cast<std::size_t>(count) : 0);
  std::memcpy(layouts.data(), bytes + kCount_B, layouts.size() * sizeof(Hdf5Layout));
  for (Hdf5Layout& layout : layouts) {
    layout.type[Hdf5Layout::kMostType_B - 1] = 0;
    for (const std::int64_t numbers : {layout.parameters, layout.fixed_parameters})
      is_usable = is_usable && numbers >= 0 && numbers <= kMostNumbers;
  }
  if (!is_usable)
    throw InputError("{}: holds too many numbers, or is damaged; save the transform again", path.string());
  return layouts;
}

std::vector<StoredTransform> transforms_of_hdf5(const fs::path& path) {
  const Hdf5Transforms& module = hdf5_module(path);
  const std::vector<Hdf5Layout> layouts = hdf5_layouts(module, path);
  std::int64_t count = 0;
  for (const Hdf5Layout& layout : layouts) count += layout.parameters + layout.fixed_parameters;
  const std::int64_t numbers_B = count * static_cast<std::int64_t>(sizeof(double));
  require_memory("the transform " + path.string(), {2 * numbers_B, 2 * numbers_B});
  const SharedMemory shared(static_cast<std::size_t>(numbers_B) + sizeof(double));
  const std::span numbers(reinterpret_cast<double*>(shared.bytes().data()), static_cast<std::size_t>(count));
  read_in_child(
      path, [&] { module.read(path.string(), numbers); }, numbers_B);
  std::vector<StoredTransform> transforms;
  const double* next = numbers.data();
  for (const Hdf5Layout& layout : layouts) {
    const double *const fixed = next + layout.parameters, *const end = fixed + layout.fixed_parameters;
    transforms.push_back({layout.type, {next, fixed}, {fixed, end}});
    next = end;
  }
  return transforms;
}

}  // namespace

bool is_transform_file(const fs::path& path) {
  const std::string leading = leading_bytes(path);
  return leading.starts_with(kTextMagic) || leading.starts_with(kHdf5Magic) || has_extension(path, ".mat");
}

std::vector<StoredTransform> read_transforms(const fs::path& path) {
  require_regular_file(path);
  const std::string leading = leading_bytes(path);
  if (leading.starts_with(kHdf5Magic)) return transforms_of_hdf5(path);
  if (leading.starts_with(kTextMagic)) return transforms_of_text(path);
  return transforms_of_matlab(path);
}

}  // namespace xraycast
