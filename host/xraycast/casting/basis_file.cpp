#include "xraycast/casting/basis_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/dicom_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/json_text.hpp"
#include "xraycast/base/remedy.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/casting/key_maps_file.hpp"
#include "xraycast/casting/outline_bands.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <zlib.h>

namespace xraycast {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are written as they lie in memory");

using nlohmann::json;

constexpr std::int64_t kMaxChunk_B = 8 << 20;

struct ChunkHead {
  std::array<char, 4> tag;
  std::uint64_t size_B;
};
constexpr std::int64_t kChunkHead_B = 4 + 8, kChecksum_B = 4;

std::uint32_t checksum(const ChunkHead& head, std::span<const char> content) {
  const auto add = [](uLong crc, const void* bytes, std::size_t size) {
    return crc32(crc, static_cast<const Bytef*>(bytes), static_cast<uInt>(size));
  };
  const uLong crc = add(add(0, head.tag.data(), 4), &head.size_B, 8);
  return static_cast<std::uint32_t>(add(crc, content.data(), content.size()));
}

template <typename T>
std::span<const char> as_chars(std::span<const T> values) {
  return {reinterpret_cast<const char*>(values.data()), values.size_bytes()};
}

// ---- header ---------------------------------------------------------------------------------------------

std::string header_of(const Basis& basis, const std::filesystem::path& path) {
  const MapGeometry& geometry = basis.geometry;
  json centres = json::array();
  for (const glm::dvec2& centre : geometry.centre_mm) centres.push_back({centre.x, centre.y});
  json header{{"projection", to_string(geometry.ray_layout)},
              {"width", geometry.width},
              {"height", geometry.height},
              {"radii_mm", geometry.radii_mm},
              {"centre_mm", centres},
              {"top_mm", geometry.top_mm},
              {"row_spacing_mm", geometry.row_spacing_mm},
              {"step_mm", geometry.step_mm},
              {"knots_hu", basis.knots_hu},
              {"hu_histogram", basis.hu_histogram},
              {"source", basis.source}};
  if (!basis.frame_of_reference_uid.empty()) header["frame_of_reference_uid"] = basis.frame_of_reference_uid;
  if (geometry.has_outline()) header["outline_radii"] = geometry.outline_mm.size();
  if (geometry.field) header["field_mm"] = geometry.field->corners_mm();
  if (basis.keys) {
    std::vector<KeyRows> rows{{-1, 0, geometry.height}};
    for (const BasisKeys::Key& key : basis.keys->others) rows.push_back(key.rows);
    header["keys"] = basis.keys->phases.to_json();
    header["key_rows"] = key_rows_text(rows);
    header["motion"] = relative_motion(basis.keys->motion, path);
  }
  // A file's name need not be UTF-8.
  return header.dump(-1, ' ', false, json::error_handler_t::replace);
}

/// The members of a header, each named in the message when it is invalid.
class HeaderReader {
 public:
  HeaderReader(std::span<const char> text, std::string file)
      : file_(std::move(file)), header_(parse_json({text.data(), text.size()}, file_)) {
    if (!header_.is_object()) throw InputError("{}: its header is not a JSON object", file_);
  }

  template <typename T>
  T get(const char* name) const {
    try {
      return header_.at(name).get<T>();
    } catch (const json::exception&) {
      throw InputError("{}: header field {} is missing or invalid", file_, name);
    }
  }

  bool has(const char* name) const { return header_.contains(name); }

  int count(const char* name) const {
    const auto field = header_.find(name);
    const auto number = field == header_.end() ? std::nullopt : whole_number(*field);
    if (!number || *number < 0 || *number > std::numeric_limits<int>::max())
      throw InputError("{}: header field {} is missing or not a count", file_, name);
    return static_cast<int>(*number);
  }

  std::vector<std::int64_t> counts(const char* name, std::size_t count) const {
    std::vector<std::int64_t> numbers;
    for (const json& value : get<std::vector<json>>(name))
      if (const auto number = whole_number(value); number && *number >= 0) numbers.push_back(*number);
    if (numbers.size() != count || header_[name].size() != count)
      throw InputError("{}: header field {} must hold {} counts", file_, name, count);
    return numbers;
  }

 private:
  std::string file_;
  json header_;
};

Basis basis_of(const HeaderReader& header, const std::string& name) {
  Basis basis;
  if (const auto projection = header.get<std::string>("projection");
      projection != to_string(RayLayout::cylinder))
    throw InputError("{}: header field projection is '{}', which this version does not know", name,
                     excerpt(projection));
  MapGeometry& geometry = basis.geometry;
  geometry.width = header.count("width");
  geometry.height = header.count("height");
  geometry.radii_mm = header.get<std::vector<double>>("radii_mm");
  for (const auto& [x, y] : header.get<std::vector<std::array<double, 2>>>("centre_mm"))
    geometry.centre_mm.emplace_back(x, y);
  geometry.top_mm = header.get<double>("top_mm");
  geometry.row_spacing_mm = header.get<double>("row_spacing_mm");
  geometry.step_mm = header.get<double>("step_mm");
  if (header.has("field_mm"))
    geometry.field = FieldOfView::between(header.get<FieldOfView::Corners>("field_mm"));
  validate(geometry, name);
  basis.knots_hu = header.get<std::vector<double>>("knots_hu");
  validate_knots(basis.knots_hu, name);
  basis.hu_histogram = header.counts("hu_histogram", XRC_HISTOGRAM_BINS);
  basis.source = header.get<std::string>("source");
  if (header.has("frame_of_reference_uid"))
    basis.frame_of_reference_uid = header.get<std::string>("frame_of_reference_uid");
  if (!basis.frame_of_reference_uid.empty() && !is_dicom_uid(basis.frame_of_reference_uid))
    throw InputError("{}: header field frame_of_reference_uid is not a DICOM UID; cast the basis again",
                     name);
  return basis;
}

// ---- chunks ---------------------------------------------------------------------------------------------

class Writer {
 public:
  /// `content_B` is what the chunks will hold.
  Writer(const std::filesystem::path& path, std::uint32_t version, std::int64_t content_B)
      : file_(path), needed_B_(content_B + kOverhead_B) {
    file_.write({kBasisMagic, 8}, needed_B_);
    put(version);
  }

  void write(const char* tag, std::span<const char> content) {
    while (!content.empty()) {
      const auto piece = content.first(std::min<std::size_t>(content.size(), kMaxChunk_B));
      ChunkHead head{{}, piece.size()};
      std::copy_n(tag, 4, head.tag.begin());
      file_.write({head.tag.data(), 4}, needed_B_);
      put(head.size_B);
      file_.write({piece.data(), piece.size()}, needed_B_);
      put(checksum(head, piece));
      content = content.subspan(piece.size());
    }
  }

  void commit() { file_.commit(); }

 private:
  template <typename T>
  void put(const T& value) {
    file_.write({reinterpret_cast<const char*>(&value), sizeof value}, needed_B_);
  }

  static constexpr std::int64_t kOverhead_B = 1000;  // of the heads of some chunks of 8 MiB
  AtomicFile file_;
  std::int64_t needed_B_;
};

class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : name_(path.string()) {
    require_regular_file(path);
    std::error_code error;
    file_.open(path, std::ios::binary);
    left_B_ = static_cast<std::int64_t>(std::filesystem::file_size(path, error));
    if (!file_ || error)
      throw InputError("{}: cannot be opened: {}; check its permissions", name_, std::strerror(errno));
    char magic[8] = {};
    if (left_B_ < 12 || !get(magic, 8) || std::memcmp(magic, kBasisMagic, 8) != 0 || !get(&version_, 4))
      throw InputError("{}: not a basis; make one with `xraycast cast --keep-basis`", name_);
    if (version_ < kBasisVersion || version_ > kBasisMotionVersion)
      throw InputError(
          "{}: basis version {}, but this program reads versions {} to {}; {}", name_, version_,
          kBasisVersion, kBasisMotionVersion,
          version_ > kBasisMotionVersion ? "use a newer xraycast" : "cast the scan again with --keep-basis");
  }

  const std::string& name() const { return name_; }
  bool has_outline() const { return version_ == kBasisOutlineVersion; }
  bool has_keys() const { return version_ == kBasisMotionVersion; }

  /// A chunk of the size that it states.
  std::vector<char> read(const char* tag) {
    const ChunkHead head = next(tag);
    std::vector<char> content(head.size_B);
    fill(head, content);
    return content;
  }

  /// `count` numbers from as many chunks as they take.
  template <typename T>
  std::vector<T> read(const char* tag, std::int64_t count) {
    if (count > left_B_ / static_cast<std::int64_t>(sizeof(T)))
      throw InputError("{}: truncated: {} bytes follow where {} needs {} numbers of {} bytes", name_, left_B_,
                       tag, count, sizeof(T));
    std::vector<T> values(static_cast<std::size_t>(count));
    std::span<char> rest(reinterpret_cast<char*>(values.data()), values.size() * sizeof(T));
    while (!rest.empty()) {
      const ChunkHead head = next(tag);
      const auto expected = std::min<std::size_t>(rest.size(), kMaxChunk_B);
      if (head.size_B != expected)
        throw InputError("{}: chunk {} ({}) is damaged: it claims {} bytes instead of {}", name_, chunk_, tag,
                         head.size_B, expected);
      fill(head, rest.first(expected));
      rest = rest.subspan(expected);
    }
    return values;
  }

  void finish() const {
    if (left_B_ > 0) throw InputError("{}: {} bytes follow the last chunk", name_, left_B_);
  }

 private:
  bool get(void* to, std::int64_t size_B) {
    left_B_ -= size_B;
    return static_cast<bool>(file_.read(static_cast<char*>(to), size_B));
  }

  ChunkHead next(const char* tag) {
    ++chunk_;
    ChunkHead head{};
    if (left_B_ < kChunkHead_B + kChecksum_B || !get(head.tag.data(), 4) || !get(&head.size_B, 8))
      throw InputError("{}: truncated before chunk {} ({})", name_, chunk_, tag);
    if (std::memcmp(head.tag.data(), tag, 4) != 0)
      throw InputError("{}: chunk {} is damaged: it is not {}", name_, chunk_, tag);
    if (head.size_B > kMaxChunk_B)
      throw InputError("{}: chunk {} ({}) is damaged: it claims {} bytes, but chunks hold up to {}", name_,
                       chunk_, tag, head.size_B, kMaxChunk_B);
    if (static_cast<std::int64_t>(head.size_B) > left_B_ - kChecksum_B)
      throw InputError("{}: truncated in chunk {} ({}): {} of {} bytes are left", name_, chunk_, tag,
                       left_B_ - kChecksum_B, head.size_B);
    return head;
  }

  void fill(const ChunkHead& head, std::span<char> content) {
    std::uint32_t stored = 0;
    if (!get(content.data(), static_cast<std::int64_t>(content.size())) || !get(&stored, 4))
      throw InputError("{}: cannot be read: {}", name_, std::strerror(errno));
    if (stored != checksum(head, content))
      throw InputError("{}: chunk {} ({}) is damaged: its checksum does not match", name_, chunk_,
                       std::string_view(head.tag.data(), 4));
  }

  std::string name_;
  std::ifstream file_;
  std::int64_t left_B_ = 0;
  std::uint32_t version_ = 0;
  int chunk_ = 0;
};

/// The rows of a basis' tiles.
std::vector<std::uint16_t> read_rows(Reader& reader, std::span<const std::uint64_t> touched,
                                     std::size_t knots) {
  std::int64_t rows = 0;
  for (const std::uint64_t mask : touched) {
    if (mask >> (knots - 1) > 1)
      throw InputError("{}: TILE names knot {}, but there are {}", reader.name(), std::bit_width(mask) - 1,
                       knots);
    rows += std::popcount(mask);
  }
  return reader.read<std::uint16_t>("ROWS", rows * Basis::kTileSlices);
}

std::shared_ptr<const BasisKeys> read_basis_keys(Reader& reader, const HeaderReader& header,
                                                 const Basis& basis, const std::filesystem::path& path) {
  KeyPhases phases =
      KeyPhases::from_json(header.get<std::string>("keys"), reader.name() + ": header field keys");
  const std::vector<KeyRows> rows =
      parse_key_rows(header.get<std::string>("key_rows"), phases.count(), basis.geometry.height,
                     reader.name() + ": header field key_rows");
  auto keys = std::make_shared<BasisKeys>(
      BasisKeys{std::move(phases), absolute_motion(header.get<std::string>("motion"), path), {}});
  for (std::size_t k = 1; k < rows.size(); ++k) {
    BasisKeys::Key& key = keys->others.emplace_back(BasisKeys::Key{rows[k], {}, {}});
    if (rows[k].count == 0) continue;
    key.touched = reader.read<std::uint64_t>("TILE", tile_count(basis.geometry));
    key.weights = read_rows(reader, key.touched, basis.knots_hu.size());
  }
  return keys;
}

Basis read_whole_basis(const std::filesystem::path& path) {
  Reader reader(path);
  const HeaderReader header(reader.read("HEAD"), reader.name());
  Basis basis = basis_of(header, reader.name());
  if (reader.has_outline() || (reader.has_keys() && header.has("outline_radii"))) {
    basis.geometry.outline_mm = reader.read<float>("OUTL", header.count("outline_radii"));
    validate(basis.geometry, reader.name());
    check_reach(basis.geometry, reader.name());
  }
  basis.touched = reader.read<std::uint64_t>("TILE", tile_count(basis.geometry));
  basis.weights = read_rows(reader, basis.touched, basis.knots_hu.size());
  if (reader.has_keys()) basis.keys = read_basis_keys(reader, header, basis, path);
  reader.finish();
  return basis;
}

}  // namespace

void write_basis(const Basis& basis, const std::filesystem::path& path) {
  const bool has_outline = basis.geometry.has_outline();
  const std::string header = header_of(basis, path);
  const auto outline = as_chars(std::span(basis.geometry.outline_mm));
  std::vector<std::span<const char>> maps{as_chars(std::span(basis.touched)),
                                          as_chars(std::span(basis.weights))};
  for (std::size_t k = 0; basis.keys && k < basis.keys->others.size(); ++k) {
    maps.push_back(as_chars(std::span(basis.keys->others[k].touched)));
    maps.push_back(as_chars(std::span(basis.keys->others[k].weights)));
  }
  std::size_t content_B = header.size() + outline.size();
  for (const auto& content : maps) content_B += content.size();
  Writer writer(path,
                basis.keys    ? kBasisMotionVersion
                : has_outline ? kBasisOutlineVersion
                              : kBasisVersion,
                static_cast<std::int64_t>(content_B));
  writer.write("HEAD", header);
  if (has_outline) writer.write("OUTL", outline);
  for (std::size_t i = 0; i < maps.size(); ++i) writer.write(i % 2 == 0 ? "TILE" : "ROWS", maps[i]);
  writer.commit();
}

Basis read_basis(const std::filesystem::path& path) {
  return with_remedy(path, "cast the scan again with --keep-basis", [&] { return read_whole_basis(path); });
}

}  // namespace xraycast
