// libFuzzer on one of the readers, which the variable XRAYCAST_FUZZED names; see tests/fuzz/CMakeLists.txt.
#include "fuzz/readers.hpp"
#include "support/temporary_folder.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <pthread.h>
#include <sanitizer/common_interface_defs.h>

using namespace xraycast;

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size_B, std::size_t largest_B);

static const Reader* reader = nullptr;
static std::unique_ptr<TemporaryFolder> folder;
static std::unique_ptr<FileToRead> file;

/// Without a name it lists them.
extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("XRAYCAST_FUZZED");
  for (const Reader& one : readers())
    if (!name)
      std::puts(one.name);
    else if (one.name == std::string(name))
      reader = &one;
  if (!reader) std::exit(name ? 2 : 0);
  folder = std::make_unique<TemporaryFolder>();
  file = std::make_unique<FileToRead>(*reader, *folder / "");
  std::atexit([] { folder.reset(); });
  // A process that decodes a slice may crash, and that is no finding.
  pthread_atfork(nullptr, nullptr, [] { __sanitizer_set_death_callback(nullptr); });
  return 0;
}

/// An empty corpus starts with a whole file.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size_B, std::size_t largest_B,
                                               unsigned seed) {
  if (size_B <= 1 && file->whole().size() <= largest_B) {
    std::ranges::copy(file->whole(), data);
    return file->whole().size();
  }
  size_B = LLVMFuzzerMutate(data, size_B, largest_B);
  if (reader->set_checksums && seed % 4 != 0) reader->set_checksums({reinterpret_cast<char*>(data), size_B});
  return size_B;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_B) {
  file->read({reinterpret_cast<const char*>(data), size_B});
  return 0;
}
