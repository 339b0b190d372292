#include "xraycast/image_file/inflated_voxels.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/inflater.hpp"
#include "xraycast/base/memory_limit.hpp"

#include <algorithm>

namespace xraycast {
void require_packed(const PackedVoxels& packed, std::int64_t needed_B) {
  std::error_code error;
  const auto file_B = static_cast<std::int64_t>(std::filesystem::file_size(packed.file, error));
  if (error)
    throw InputError("{}: cannot be opened: {}; check its permissions", packed.file.string(),
                     error.message());
  const std::int64_t size_B = file_B - packed.start_B;
  if ((packed.skipped_B + needed_B) / kDeflateLimit > size_B)
    throw InputError("{}: truncated, {} compressed bytes cannot hold {} bytes of voxels; copy the file again",
                     packed.file.string(), std::max<std::int64_t>(0, size_B), needed_B);
}

std::unique_ptr<char[]> inflate_voxels(const PackedVoxels& packed, std::int64_t needed_B) {
  require_packed(packed, needed_B);
  Inflater stream(packed.file, packed.start_B, Inflater::Format::zlib_or_gzip);
  stream.skip(packed.skipped_B);
  require_memory("unpacking " + packed.file.string(), {needed_B, needed_B});
  auto voxels = std::make_unique_for_overwrite<char[]>(static_cast<std::size_t>(needed_B));
  const std::int64_t got = stream.read({voxels.get(), static_cast<std::size_t>(needed_B)});
  if (got < needed_B)
    throw InputError("{}: truncated, {} of {} bytes of voxels are there; copy the file again",
                     packed.file.string(), got, needed_B);
  stream.skip();
  return voxels;
}

}  // namespace xraycast
