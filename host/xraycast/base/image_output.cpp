#include "xraycast/base/image_output.hpp"

#include "xraycast/base/atomic_file.hpp"
#include "xraycast/base/error.hpp"

#include <OpenImageIO/filesystem.h>

#include <cstdio>
#include <memory>
#include <vector>

namespace xraycast {

void write_image_file(std::span<const ImagePart> parts, const char* format,
                      const std::filesystem::path& path) {
  AtomicFile file(path);
  const auto out = OIIO::ImageOutput::create(format);
  if (!out) throw Error("{}: OpenImageIO cannot write {}", path.string(), format);
  // Files that OpenImageIO opens itself it also closes itself, and does not say when their last bytes find
  // the disk full.
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(file.temporary().c_str(), "wb"),
                                                         &std::fclose);
  bool ok = stream != nullptr;
  if (ok) {
    OIIO::Filesystem::IOFile proxy(stream.get(), OIIO::Filesystem::IOProxy::Write);
    std::vector<OIIO::ImageSpec> specs;
    for (const ImagePart& part : parts) specs.push_back(part.spec);
    const std::string name = file.temporary().string();
    ok = out->set_ioproxy(&proxy) && out->open(name, static_cast<int>(specs.size()), specs.data());
    for (std::size_t i = 0; ok && i < parts.size(); ++i)
      ok = (i == 0 || out->open(name, specs[i], OIIO::ImageOutput::AppendSubimage)) &&
           out->write_image(specs[i].format, parts[i].pixels);
    ok = out->close() && ok;
  }
  ok = ok && std::fclose(stream.release()) == 0;
  if (!ok)
    throw Error("{}: could not be written to its end; the disk may be full: {}", path.string(),
                out->geterror());
  file.commit();
}

}  // namespace xraycast
