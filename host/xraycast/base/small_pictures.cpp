#include "xraycast/base/small_pictures.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/base/picture_formats.hpp"
#include "xraycast/base/printable.hpp"
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
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <half.h>
#include <memory>
#include <new>
#include <png.h>
#include <thread>

namespace xraycast {
namespace {

Imf::PixelType pixel_type(bool is_half) { return is_half ? Imf::HALF : Imf::FLOAT; }

Imf::Header header_of(const ExrPart& part) {
  const auto window = [&](int first, int rows) {
    return Imath::Box2i({0, first}, {part.width - 1, first + rows - 1});
  };
  Imf::Header header(window(0, part.all_rows > 0 ? part.all_rows : part.height),
                     window(part.first_row, part.height));
  if (!part.name.empty()) header.setName(part.name);
  header.setType(Imf::SCANLINEIMAGE);
  header.compression() = part.is_packed_by_row ? Imf::ZIPS_COMPRESSION : Imf::ZIP_COMPRESSION;
  for (const auto& [name, values] : part.channels)
    header.channels().insert(name, Imf::Channel(pixel_type(part.is_half)));
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

RgbPicture read_png_file(const std::filesystem::path& path) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  if (!png_image_begin_read_from_file(&image, path.c_str())) throw Error("{}", image.message);
  const std::unique_ptr<png_image, decltype(&png_image_free)> freed(&image, png_image_free);
  const std::int64_t size_B = std::int64_t{3} * image.width * image.height;
  require_memory("reading a PNG", {size_B, size_B});
  image.format = PNG_FORMAT_RGB;
  RgbPicture picture{static_cast<int>(image.width), static_cast<int>(image.height),
                     std::vector<std::uint8_t>(size_B)};
  constexpr png_color kBlack{};
  if (!png_image_finish_read(&image, &kBlack, picture.rgb.data(), 0, nullptr))
    throw Error("{}", image.message);
  return picture;
}

namespace {

/// What reads a PNG, and the file that it reads.
struct PngReading {
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file;
  png_structp png = nullptr;
  png_infop info = nullptr;
  std::string problem{};  ///< what libpng says, which would write it on stderr
  bool is_memory_short = false;

  explicit PngReading(const std::filesystem::path& path) : file(std::fopen(path.c_str(), "rb"), std::fclose) {
    if (!file) throw InputError("{}", std::strerror(errno));
    const auto fail = [](png_structp failed, png_const_charp message) {
      static_cast<PngReading*>(png_get_error_ptr(failed))->problem = message;
      png_longjmp(failed, 1);
    };
    const auto allocate = [](png_structp of, png_alloc_size_t size_B) {
      void* const memory = std::malloc(size_B);
      if (!memory) static_cast<PngReading*>(png_get_mem_ptr(of))->is_memory_short = true;
      return memory;
    };
    png = png_create_read_struct_2(
        PNG_LIBPNG_VER_STRING, this, fail, [](png_structp, png_const_charp) {}, this, allocate,
        [](png_structp, png_voidp memory) { std::free(memory); });
    if (!png) throw std::bad_alloc();
    info = png_create_info_struct(png);
    if (!info) {
      png_destroy_read_struct(&png, nullptr, nullptr);
      throw std::bad_alloc();
    }
    png_init_io(png, file.get());
  }
  PngReading(const PngReading&) = delete;
  PngReading& operator=(const PngReading&) = delete;
  ~PngReading() { png_destroy_read_struct(&png, &info, nullptr); }

  /// Runs calls of libpng, which leave no object to destroy where one of them fails.
  template <typename Calls>
  void run(const Calls& calls) {
    if (setjmp(png_jmpbuf(png)) == 0) return calls();
    if (is_memory_short) throw std::bad_alloc();
    throw InputError("{}", problem);
  }
};

}  // namespace

FloatPicture read_grey_png(const std::filesystem::path& path) {
  PngReading reading(path);
  const png_structp png = reading.png;
  const png_infop info = reading.info;
  reading.run([&] {
    png_read_info(png, info);
    png_set_expand(png);
    png_set_strip_alpha(png);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
  });
  const auto width = png_get_image_width(png, info), height = png_get_image_height(png, info);
  if (std::max(width, height) > png_uint_32{kMostPicturePixels}) throw InputError("{}", kTooManyPixels);
  const std::size_t row_B = png_get_rowbytes(png, info), channels = png_get_channels(png, info);
  const bool has_16_bits = png_get_bit_depth(png, info) == 16;
  const std::int64_t pixels = std::int64_t{width} * height,
                     size_B = static_cast<std::int64_t>(row_B * height) + 4 * pixels;
  require_memory("reading a PNG", {size_B, size_B});
  std::vector<png_byte> bytes(row_B * height);
  std::vector<png_bytep> rows;
  for (png_uint_32 y = 0; y < height; ++y) rows.push_back(bytes.data() + row_B * y);
  reading.run([&] { png_read_image(png, rows.data()); });

  FloatPicture picture{static_cast<int>(width), static_cast<int>(height), {}, false};
  picture.grey.reserve(static_cast<std::size_t>(pixels));
  const png_byte* next = bytes.data();
  while (picture.grey.size() < static_cast<std::size_t>(pixels)) {
    int sum = 0;
    for (std::size_t c = 0; c < channels; ++c, next += has_16_bits ? 2 : 1)
      sum += has_16_bits ? 256 * next[0] + next[1] : next[0];
    picture.grey.push_back(static_cast<float>(sum) / static_cast<float>(channels));
  }
  return picture;
}

void write_exr(std::span<const ExrPart> parts, const std::filesystem::path& path) {
  constexpr std::int64_t kHeader_B = 4000, kRow_B = 16;
  AtomicFile file(path);
  std::vector<Imf::Header> headers;
  std::int64_t most_B = 0;  // where nothing can be packed
  for (const ExrPart& part : parts) {
    headers.push_back(header_of(part));
    most_B +=
        kHeader_B + part.height * (kRow_B + (part.is_half ? 2 : 4) * std::ssize(part.channels) * part.width);
  }
  // OpenEXR deflates in a pool of threads of the whole process, initially none. A program's setting is kept.
  if (Imf::globalThreadCount() == 0)
    Imf::setGlobalThreadCount(static_cast<int>(std::thread::hardware_concurrency()));
  errno = 0;
  std::ofstream out(file.temporary(), std::ios::binary);
  std::string problem;
  try {
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
  if (!out) throw file.failure(errno, most_B);
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

void ExrReader::check(exr_result_t result) const {
  if (result != EXR_ERR_SUCCESS)
    throw InputError("{}: damaged or truncated: {}", name_, exr_get_default_error_message(result));
}

ExrReader::ExrReader(const std::filesystem::path& path) : name_(path.string()) {
  exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
  options.error_handler_fn = [](exr_const_context_t, exr_result_t, const char*) {};  // else to stderr
  exr_context_t context = nullptr;
  const exr_result_t result = exr_start_read(&context, path.c_str(), &options);
  context_.reset(context);
  check(result);

  constexpr double kMaxDeflated = 1032;  // times; zlib's limit
  double claimed_B = 0;
  for (int part = 0; part < parts(); ++part) {
    exr_storage_t storage{};
    check(exr_get_storage(context, part, &storage));
    if (storage != EXR_STORAGE_SCANLINE)
      throw InputError("{}: part {} is tiled or deep, but only scan lines are read", name_, part);
    for (const exr_attr_chlist_entry_t& channel : channels(part))
      claimed_B += (channel.pixel_type == EXR_PIXEL_HALF ? 2.0 : 4.0) * size(part).x * size(part).y;
  }
  const auto size_B = static_cast<double>(std::filesystem::file_size(path));
  if (claimed_B > kMaxDeflated * size_B)
    throw InputError("{}: damaged: a file of {:.0f} bytes cannot hold pixels of {:.0f}", name_, size_B,
                     claimed_B);
}

int ExrReader::parts() const {
  int count = 0;
  check(exr_get_count(context_.get(), &count));
  return count;
}

exr_attr_box2i_t ExrReader::window(int part) const {
  exr_attr_box2i_t window{};
  check(exr_get_data_window(context_.get(), part, &window));
  return window;
}

glm::ivec2 ExrReader::size(int part) const {
  const auto [min, max] = window(part);
  return {max.x - min.x + 1, max.y - min.y + 1};
}

std::span<const exr_attr_chlist_entry_t> ExrReader::channels(int part) const {
  const exr_attr_chlist_t* channels = nullptr;
  check(exr_get_channels(context_.get(), part, &channels));
  return {channels->entries, static_cast<std::size_t>(channels->num_channels)};
}

const exr_attribute_t* ExrReader::attribute(const std::string& name, exr_attribute_type_t type) const {
  const exr_attribute_t* found = nullptr;
  const exr_result_t result = exr_get_attribute_by_name(context_.get(), 0, name.c_str(), &found);
  return result == EXR_ERR_SUCCESS && found->type == type ? found : nullptr;
}

std::string ExrReader::text(const std::string& name) const {
  const exr_attribute_t* found = attribute(name, EXR_ATTR_STRING);
  return found ? std::string(found->string->str, static_cast<std::size_t>(found->string->length)) : "";
}

int ExrReader::number(const std::string& name) const {
  const exr_attribute_t* found = attribute(name, EXR_ATTR_INT);
  return found ? found->i : 0;
}

void ExrReader::read(int part, bool is_half, const std::map<std::string, std::span<float>>& targets) const {
  std::vector<float*> values;  // of the file's channels, in their order
  for (const exr_attr_chlist_entry_t& channel : channels(part)) {
    const auto target = targets.find(channel.name.str);
    if (target == targets.end() || channel.pixel_type != (is_half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT) ||
        channel.x_sampling != 1 || channel.y_sampling != 1)
      throw InputError("{}: layer {} has an unexpected channel {}", name_, part, excerpt(channel.name.str));
    values.push_back(target->second.data());
  }
  for (const auto& [channel, target] : targets)
    if (std::ranges::find(values, target.data()) == values.end())
      throw InputError("{}: layer {} has no channel {}", name_, part, channel);

  struct Decoder {
    exr_const_context_t context;
    exr_decode_pipeline_t pipeline{};
    ~Decoder() { exr_decoding_destroy(context, &pipeline); }
  } decoder{context_.get()};
  exr_decode_pipeline_t& pipeline = decoder.pipeline;
  const auto [min, max] = window(part);
  const std::ptrdiff_t width = size(part).x;
  int rows = 0;
  check(exr_get_scanlines_per_chunk(decoder.context, part, &rows));
  for (std::int64_t y = min.y; y <= max.y; y += rows) {
    exr_chunk_info_t chunk{};
    check(exr_read_scanline_chunk_info(decoder.context, part, static_cast<int>(y), &chunk));
    const bool is_first = y == min.y;
    check(is_first ? exr_decoding_initialize(decoder.context, part, &chunk, &pipeline)
                   : exr_decoding_update(decoder.context, part, &chunk, &pipeline));
    for (std::size_t c = 0; c < values.size(); ++c) {
      exr_coding_channel_info_t& channel = pipeline.channels[c];
      channel.decode_to_ptr = reinterpret_cast<std::uint8_t*>(values[c] + (y - min.y) * width);
      channel.user_data_type = EXR_PIXEL_FLOAT;
      channel.user_bytes_per_element = sizeof(float);
      channel.user_pixel_stride = sizeof(float);
      channel.user_line_stride = static_cast<std::int32_t>(sizeof(float) * static_cast<std::size_t>(width));
    }
    if (is_first) check(exr_decoding_choose_default_routines(decoder.context, part, &pipeline));
    check(exr_decoding_run(decoder.context, part, &pipeline));
  }
}

}  // namespace xraycast
