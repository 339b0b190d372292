#include "xraycast/base/exr_file.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/whole_file.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStdIO.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <half.h>
#include <openexr.h>
#include <thread>

namespace xraycast {
namespace {

Imf::Header header_of(const ExrPart& part) {
  Imf::Header header(part.width, part.height);
  if (!part.name.empty()) header.setName(part.name);
  header.setType(Imf::SCANLINEIMAGE);
  header.compression() =
      part.compression == ExrCompression::zip ? Imf::ZIP_COMPRESSION : Imf::ZIPS_COMPRESSION;
  for (const ExrChannel& channel : part.channels)
    header.channels().insert(channel.name,
                             Imf::Channel(channel.pixel == ExrPixel::float16 ? Imf::HALF : Imf::FLOAT));
  for (const auto& [name, value] : part.attributes)
    if (const int* number = std::get_if<int>(&value))
      header.insert(name, Imf::IntAttribute(*number));
    else
      header.insert(name, Imf::StringAttribute(std::get<std::string>(value)));
  return header;
}

std::size_t pixel_B(ExrPixel pixel) { return pixel == ExrPixel::float16 ? sizeof(half) : sizeof(float); }

/// The pixels of a part as its file stores them.
class PartPixels {
 public:
  explicit PartPixels(const ExrPart& part) {
    halves_.reserve(part.channels.size());
    for (const ExrChannel& channel : part.channels) {
      const bool is_half = channel.pixel == ExrPixel::float16;
      if (is_half) halves_.emplace_back(channel.values.begin(), channel.values.end());
      const void* pixels = is_half ? static_cast<const void*>(halves_.back().data()) : channel.values.data();
      const std::size_t stride = pixel_B(channel.pixel);
      // A frame buffer serves reading too, and so its pointers are not to constants.
      buffer_.insert(channel.name, Imf::Slice(is_half ? Imf::HALF : Imf::FLOAT,
                                              static_cast<char*>(const_cast<void*>(pixels)), stride,
                                              stride * static_cast<std::size_t>(part.width)));
    }
  }

  const Imf::FrameBuffer& frame_buffer() const { return buffer_; }

 private:
  std::vector<std::vector<half>> halves_;
  Imf::FrameBuffer buffer_;
};

/// What the file takes where nothing can be packed.
std::int64_t most_bytes(std::span<const ExrPart> parts) {
  constexpr std::int64_t kHeader_B = 4000, kRow_B = 16;
  std::int64_t sum = 0;
  for (const ExrPart& part : parts) {
    sum += kHeader_B + kRow_B * part.height;
    for (const ExrChannel& channel : part.channels)
      sum += static_cast<std::int64_t>(channel.values.size() * pixel_B(channel.pixel));
  }
  return sum;
}

exr_pixel_type_t stored_as(ExrPixel pixel) {
  return pixel == ExrPixel::float16 ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
}

/// OpenEXR deflates in a pool of threads that the whole process shares, initially without threads. A
/// program's own setting is kept.
void use_all_cores() {
  static const bool once = [] {
    if (Imf::globalThreadCount() == 0)
      Imf::setGlobalThreadCount(static_cast<int>(std::thread::hardware_concurrency()));
    return true;
  }();
  static_cast<void>(once);
}

}  // namespace

void write_exr(std::span<const ExrPart> parts, const std::filesystem::path& path) {
  AtomicFile file(path);
  errno = 0;
  std::ofstream out(file.temporary(), std::ios::binary);
  std::string problem;
  try {
    std::vector<Imf::Header> headers;
    for (const ExrPart& part : parts) headers.push_back(header_of(part));
    use_all_cores();
    Imf::StdOFStream stream(out, path.c_str());
    Imf::MultiPartOutputFile exr(stream, headers.data(), static_cast<int>(headers.size()));
    for (std::size_t k = 0; k < parts.size(); ++k) {
      Imf::OutputPart part(exr, static_cast<int>(k));
      const PartPixels pixels(parts[k]);
      part.setFrameBuffer(pixels.frame_buffer());
      part.writePixels(parts[k].height);
    }
  } catch (const std::exception& error) {
    problem = error.what();
  }
  // OpenEXR's destructors write the tables of rows, and do not report when that fails; the stream does.
  out.close();
  if (!out) throw file.failure(errno, most_bytes(parts));
  if (!problem.empty()) throw Error("{}: could not be written: {}", path.string(), problem);
  file.commit();
}

bool is_exr(const std::filesystem::path& path) {
  constexpr std::array<char, 4> kMagic{0x76, 0x2f, 0x31, 0x01};
  require_regular_file(path);
  std::ifstream in(path, std::ios::binary);
  if (!in)
    throw InputError("{}: cannot be opened: {}; check its permissions", path.string(), std::strerror(errno));
  std::array<char, 4> first{};
  return in.read(first.data(), first.size()) && first == kMagic;
}

// Files are read by OpenEXR's C library: it checks the sizes in headers against the file's size, where the
// C++ one allocates whatever an attribute claims.
struct ExrReader::File {
  std::string name;
  exr_context_t context = nullptr;

  ~File() { exr_finish(&context); }

  void check(exr_result_t result) const {
    if (result != EXR_ERR_SUCCESS)
      throw InputError("{}: damaged or truncated: {}", name, exr_get_default_error_message(result));
  }

  exr_attr_box2i_t window(int part) const {
    exr_attr_box2i_t window{};
    check(exr_get_data_window(context, part, &window));
    return window;
  }

  const exr_attr_chlist_t& channels(int part) const {
    const exr_attr_chlist_t* channels = nullptr;
    check(exr_get_channels(context, part, &channels));
    return *channels;
  }

  const exr_attribute_t* attribute(const std::string& attribute, exr_attribute_type_t type) const {
    const exr_attribute_t* found = nullptr;
    const bool is_there = exr_get_attribute_by_name(context, 0, attribute.c_str(), &found) == EXR_ERR_SUCCESS;
    return is_there && found->type == type ? found : nullptr;
  }
};

ExrReader::ExrReader(const std::filesystem::path& path) : file_(std::make_unique<File>()) {
  file_->name = path.string();
  std::error_code error;
  const auto size_B = static_cast<double>(std::filesystem::file_size(path, error));
  if (error) throw InputError("{}: cannot be read: {}", file_->name, error.message());
  exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
  options.error_handler_fn = [](exr_const_context_t, exr_result_t, const char*) {};  // else to stderr
  file_->check(exr_start_read(&file_->context, path.c_str(), &options));

  constexpr double kMaxDeflated = 1032;  // times; zlib's limit
  double claimed_B = 0;
  for (int part = 0; part < parts(); ++part) {
    exr_storage_t storage{};
    file_->check(exr_get_storage(file_->context, part, &storage));
    if (storage != EXR_STORAGE_SCANLINE)
      throw InputError("{}: part {} is tiled or deep, but only scan lines are read", file_->name, part);
    const exr_attr_chlist_t& channels = file_->channels(part);
    for (const exr_attr_chlist_entry_t& channel : std::span(channels.entries, channels.num_channels)) {
      const double one_B = channel.pixel_type == EXR_PIXEL_HALF ? sizeof(half) : sizeof(float);
      claimed_B += one_B * width(part) * height(part);
    }
  }
  if (claimed_B > kMaxDeflated * size_B)
    throw InputError("{}: damaged: a file of {:.0f} bytes cannot hold pixels of {:.0f}", file_->name, size_B,
                     claimed_B);
}

ExrReader::~ExrReader() = default;

int ExrReader::parts() const {
  int count = 0;
  file_->check(exr_get_count(file_->context, &count));
  return count;
}

int ExrReader::width(int part) const {
  const exr_attr_box2i_t window = file_->window(part);
  return window.max.x - window.min.x + 1;
}

int ExrReader::height(int part) const {
  const exr_attr_box2i_t window = file_->window(part);
  return window.max.y - window.min.y + 1;
}

std::optional<std::string> ExrReader::text(const std::string& attribute) const {
  const exr_attribute_t* found = file_->attribute(attribute, EXR_ATTR_STRING);
  if (!found) return std::nullopt;
  return std::string(found->string->str, static_cast<std::size_t>(found->string->length));
}

std::optional<int> ExrReader::number(const std::string& attribute) const {
  const exr_attribute_t* found = file_->attribute(attribute, EXR_ATTR_INT);
  return found ? std::optional(found->i) : std::nullopt;
}

void ExrReader::read(int part, std::span<const ExrTarget> targets) const {
  const exr_attr_chlist_t& channels = file_->channels(part);
  std::vector<float*> values;  // of the file's channels, in their order
  for (const exr_attr_chlist_entry_t& channel : std::span(channels.entries, channels.num_channels)) {
    const auto target = std::ranges::find(targets, channel.name.str, &ExrTarget::channel);
    const bool is_sampled = channel.x_sampling == 1 && channel.y_sampling == 1;
    if (target == targets.end() || channel.pixel_type != stored_as(target->pixel) || !is_sampled)
      throw InputError("{}: layer {} has an unexpected channel {}", file_->name, part,
                       excerpt(channel.name.str));
    values.push_back(target->values.data());
  }
  for (const ExrTarget& target : targets)
    if (std::ranges::find(values, target.values.data()) == values.end())
      throw InputError("{}: layer {} has no channel {}", file_->name, part, target.channel);

  struct Decoder {
    exr_const_context_t context;
    exr_decode_pipeline_t pipeline{};
    ~Decoder() { exr_decoding_destroy(context, &pipeline); }
  } decoder{file_->context};
  exr_decode_pipeline_t& pipeline = decoder.pipeline;
  const exr_attr_box2i_t window = file_->window(part);
  const std::ptrdiff_t width = this->width(part);
  int rows = 0;
  file_->check(exr_get_scanlines_per_chunk(file_->context, part, &rows));
  for (std::int64_t y = window.min.y; y <= window.max.y; y += rows) {
    exr_chunk_info_t chunk{};
    file_->check(exr_read_scanline_chunk_info(file_->context, part, static_cast<int>(y), &chunk));
    const bool is_first = y == window.min.y;
    file_->check(is_first ? exr_decoding_initialize(file_->context, part, &chunk, &pipeline)
                          : exr_decoding_update(file_->context, part, &chunk, &pipeline));
    for (std::size_t c = 0; c < values.size(); ++c) {
      exr_coding_channel_info_t& channel = pipeline.channels[c];
      channel.decode_to_ptr = reinterpret_cast<std::uint8_t*>(values[c] + (y - window.min.y) * width);
      channel.user_data_type = EXR_PIXEL_FLOAT;
      channel.user_bytes_per_element = sizeof(float);
      channel.user_pixel_stride = sizeof(float);
      channel.user_line_stride = static_cast<std::int32_t>(sizeof(float) * static_cast<std::size_t>(width));
    }
    if (is_first) file_->check(exr_decoding_choose_default_routines(file_->context, part, &pipeline));
    file_->check(exr_decoding_run(file_->context, part, &pipeline));
  }
}

}  // namespace xraycast
