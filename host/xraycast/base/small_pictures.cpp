#include "xraycast/base/small_pictures.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/printable.hpp"
#include "xraycast/base/whole_file.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
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
#include <mutex>
#include <openexr.h>
#include <png.h>
#include <thread>

namespace xraycast {
namespace {

Imf::PixelType pixel_type(bool is_half) { return is_half ? Imf::HALF : Imf::FLOAT; }

Imf::Header header_of(const ExrPart& part) {
  Imf::Header header(part.width, part.height);
  if (!part.name.empty()) header.setName(part.name);
  header.setType(Imf::SCANLINEIMAGE);
  header.compression() = part.is_packed_by_row ? Imf::ZIPS_COMPRESSION : Imf::ZIP_COMPRESSION;
  for (const ExrChannel& channel : part.channels)
    header.channels().insert(channel.name, Imf::Channel(pixel_type(part.is_half)));
  for (const auto& [name, value] : part.attributes)
    if (const int* number = std::get_if<int>(&value))
      header.insert(name, Imf::IntAttribute(*number));
    else
      header.insert(name, Imf::StringAttribute(std::get<std::string>(value)));
  return header;
}

void write_pixels(const ExrPart& part, const Imath::Box2i& window, Imf::OutputPart& file) {
  std::vector<std::vector<half>> halves;
  Imf::FrameBuffer buffer;
  for (const auto& [name, values] : part.channels) {
    const void* pixels = values.data();
    if (part.is_half) pixels = halves.emplace_back(values.begin(), values.end()).data();
    buffer.insert(name, Imf::Slice::Make(pixel_type(part.is_half), pixels, window));
  }
  file.setFrameBuffer(buffer);
  file.writePixels(part.height);
}

/// What the file takes where nothing can be packed.
std::int64_t most_bytes(std::span<const ExrPart> parts) {
  constexpr std::int64_t kHeader_B = 4000, kRow_B = 16;
  std::int64_t sum_B = 0;
  for (const auto& part : parts)
    sum_B +=
        kHeader_B + part.height * (kRow_B + (part.is_half ? 2 : 4) * std::ssize(part.channels) * part.width);
  return sum_B;
}

/// OpenEXR deflates in a pool of threads that the whole process shares, initially without threads. A
/// program's own setting is kept.
void use_all_cores() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (Imf::globalThreadCount() == 0)
      Imf::setGlobalThreadCount(static_cast<int>(std::thread::hardware_concurrency()));
  });
}

/// By OpenEXR's C library, which checks the sizes in strict headers against the file's: the C++ one, which
/// reads the file after that, allocates what they claim.
void check_headers(const std::string& path) {
  struct Context {
    exr_context_t handle = nullptr;
    ~Context() { exr_finish(&handle); }
  } context;
  exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
  options.error_handler_fn = [](exr_const_context_t, exr_result_t, const char*) {};  // else to stderr
  options.flags = EXR_CONTEXT_FLAG_STRICT_HEADER;
  const auto check = [&](exr_result_t result) {
    if (result != EXR_ERR_SUCCESS)
      throw InputError("{}: damaged or truncated: {}", path, exr_get_default_error_message(result));
  };
  check(exr_start_read(&context.handle, path.c_str(), &options));
  int parts = 0;
  check(exr_get_count(context.handle, &parts));
  double claimed_B = 0;
  for (int part = 0; part < parts; ++part) {
    exr_storage_t storage{};
    exr_attr_box2i_t window{};
    const exr_attr_chlist_t* channels = nullptr;
    check(exr_get_storage(context.handle, part, &storage));
    check(exr_get_data_window(context.handle, part, &window));
    check(exr_get_channels(context.handle, part, &channels));
    if (storage != EXR_STORAGE_SCANLINE)
      throw InputError("{}: part {} is tiled or deep, but only scan lines are read", path, part);
    for (const exr_attr_chlist_entry_t& channel : std::span(channels->entries, channels->num_channels))
      claimed_B += (channel.pixel_type == EXR_PIXEL_HALF ? 2 : 4) * (1.0 + window.max.x - window.min.x) *
                   (1.0 + window.max.y - window.min.y);
  }
  constexpr double kMaxDeflated = 1032;  // times; zlib's limit
  const auto size_B = static_cast<double>(std::filesystem::file_size(path));
  if (claimed_B > kMaxDeflated * size_B)
    throw InputError("{}: damaged: a file of {:.0f} bytes cannot hold pixels of {:.0f}", path, size_B,
                     claimed_B);
}

/// What `read` returns; what OpenEXR throws becomes an InputError.
template <typename Read>
auto reading(const std::string& path, const Read& read) {
  try {
    return read();
  } catch (const Iex::BaseExc& error) {
    throw InputError("{}: damaged or truncated: {}", path, excerpt(error.what()));
  }
}

}  // namespace

std::string png_bytes(std::span<const std::uint8_t> pixels, int width, int height, int channels) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = channels == 1 ? PNG_FORMAT_GRAY : PNG_FORMAT_RGB;
  png_alloc_size_t size_B = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size_B, '\0');
  if (!png_image_write_to_memory(&image, bytes.data(), &size_B, 0, pixels.data(), channels * width, nullptr))
    throw Error("a PNG of {} x {} pixels could not be made: {}", width, height, image.message);
  bytes.resize(size_B);
  return bytes;
}

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
      write_pixels(parts[k], headers[k].dataWindow(), part);
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

Imf::MultiPartInputFile open_exr(const std::filesystem::path& path) {
  check_headers(path.string());
  // No threads: callers read parts in their own. No search for the rows of a file without a table of them.
  return reading(path.string(), [&] { return Imf::MultiPartInputFile(path.c_str(), 0, false); });
}

Imath::V2i exr_size(const Imf::MultiPartInputFile& file, int part) {
  return file.header(part).dataWindow().size() + Imath::V2i(1);
}

void read_exr_part(Imf::MultiPartInputFile& file, int part, bool is_half, std::span<const ExrTarget> targets,
                   const std::string& path) {
  const Imf::ChannelList& channels = file.header(part).channels();
  for (auto channel = channels.begin(); channel != channels.end(); ++channel)
    if (std::ranges::find(targets, channel.name(), &ExrTarget::channel) == targets.end() ||
        !(channel.channel() == Imf::Channel(pixel_type(is_half))))
      throw InputError("{}: layer {} has an unexpected channel {}", path, part, excerpt(channel.name()));
  const Imath::Box2i& window = file.header(part).dataWindow();
  Imf::FrameBuffer buffer;
  for (const auto& [channel, values] : targets) {
    if (!channels.findChannel(channel))
      throw InputError("{}: layer {} has no channel {}", path, part, channel);
    buffer.insert(channel, Imf::Slice::Make(Imf::FLOAT, values.data(), window));
  }
  reading(path, [&] {
    Imf::InputPart in(file, part);
    in.setFrameBuffer(buffer);
    in.readPixels(window.min.y, window.max.y);
  });
}

}  // namespace xraycast
