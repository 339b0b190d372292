#include "xraycast/scan/unpacked_zip.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/printable.hpp"

#include <algorithm>
#include <fstream>
#include <memory>
#include <vector>
#include <zip.h>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

struct Entry {
  zip_uint64_t index;
  std::string name;
  std::int64_t size_B, packed_B;
};

using Archive = std::unique_ptr<zip_t, decltype(&zip_discard)>;

Archive open_archive(const fs::path& path) {
  int error = 0;
  Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &error), &zip_discard);
  if (!archive) throw InputError("{}: not a complete zip archive; copy it again", path.string());
  return archive;
}

/// The files in it, sorted by name as in a folder.
std::vector<Entry> entries_of(zip_t* archive, const fs::path& path) {
  const zip_int64_t count = zip_get_num_entries(archive, 0);
  constexpr zip_int64_t kMostEntries = 200'000;
  if (count > kMostEntries)
    throw InputError("{}: {} files in the archive, more than {}; unpack it and give the folder",
                     path.string(), count, kMostEntries);
  std::vector<Entry> entries;
  for (zip_int64_t i = 0; i < count; ++i) {
    zip_stat_t status;
    zip_stat_init(&status);
    constexpr zip_uint64_t kNeeded = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE;
    constexpr zip_uint64_t kMostBytes = zip_uint64_t{1} << 50;
    if (zip_stat_index(archive, static_cast<zip_uint64_t>(i), ZIP_FL_ENC_GUESS, &status) != 0 ||
        (status.valid & kNeeded) != kNeeded || status.size > kMostBytes || status.comp_size > kMostBytes)
      throw InputError("{}: the archive's directory is damaged; copy it again", path.string());
    const std::string name = status.name;
    if (status.size > 0 && !name.ends_with('/'))
      entries.push_back({static_cast<zip_uint64_t>(i), name, static_cast<std::int64_t>(status.size),
                         static_cast<std::int64_t>(status.comp_size)});
  }
  std::ranges::sort(entries, {}, &Entry::name);
  return entries;
}

/// Refuses archives that are made to fill disks: ones whose files overlap, or are packed as no scan is.
void check_sizes(const std::vector<Entry>& entries, const fs::path& path, const fs::path& folder) {
  constexpr std::int64_t kMostPacked = 200, kLittle_B = 64 << 20;
  const auto archive_B = static_cast<std::int64_t>(fs::file_size(path));
  std::int64_t size_B = 0, packed_B = 0;
  for (const Entry& entry : entries) {
    size_B += entry.size_B;
    packed_B += entry.packed_B;
    if (packed_B > archive_B)
      throw InputError("{}: its files overlap, so the archive is damaged; copy it again", path.string());
    if (size_B > kMostPacked * archive_B + kLittle_B)
      throw InputError("{}: it unpacks to more than {} times its size; unpack it and give the folder",
                       path.string(), kMostPacked);
  }
  constexpr std::int64_t kLeftFree_B = 64 << 20;
  const auto free_B = static_cast<std::int64_t>(fs::space(folder).available);
  if (size_B > free_B - kLeftFree_B)
    throw InputError("{}: needs {} MB in {}, where {} MB are free; set TMPDIR to a larger disk",
                     path.string(), size_B >> 20, folder.parent_path().string(), free_B >> 20);
}

void unpack(zip_t* archive, const Entry& entry, const fs::path& target, const std::string& name) {
  const std::unique_ptr<zip_file_t, decltype(&zip_fclose)> file(zip_fopen_index(archive, entry.index, 0),
                                                                &zip_fclose);
  if (!file) {
    const int reason = zip_error_code_zip(zip_get_error(archive));
    throw InputError("{}: {}", name,
                     reason == ZIP_ER_NOPASSWD ? "encrypted; unpack it and give the folder"
                     : reason == ZIP_ER_COMPNOTSUPP || reason == ZIP_ER_ENCRNOTSUPP
                         ? "compressed by an unsupported method; unpack it and give the folder"
                         : "damaged; copy the archive again");
  }
  std::ofstream stream(target, std::ios::binary);
  std::vector<char> buffer(1 << 18);
  std::int64_t left_B = entry.size_B;
  // Read to its end, where the checksum is compared.
  for (;;) {
    const zip_int64_t count = zip_fread(file.get(), buffer.data(), buffer.size());
    if (count < 0 || count > left_B || (count == 0 && left_B > 0))
      throw InputError("{}: damaged: its size or checksum does not match; copy the archive again", name);
    if (count == 0) break;
    stream.write(buffer.data(), count);
    left_B -= count;
  }
  stream.close();
  if (!stream) throw Error("{}: the temporary folder is full; set TMPDIR to a larger disk", target.string());
}

}  // namespace

UnpackedZip::UnpackedZip(const fs::path& archive, Progress& progress) : archive_(archive.string()) {
  const Archive zip = open_archive(archive);
  const std::vector<Entry> entries = entries_of(zip.get(), archive);
  if (entries.empty()) throw InputError("{}: the archive is empty; copy it again", archive_);
  check_sizes(entries, archive, folder());
  progress.begin("unpacking", std::ssize(entries), "files");
  std::map<fs::path, std::string> folders;
  for (const Entry& entry : entries) {
    const auto [place, is_new] =
        folders.try_emplace(fs::path(entry.name).parent_path(), fmt::format("{:06}", folders.size()));
    fs::create_directory(folder() / place->second);
    const fs::path target = folder() / place->second / fmt::format("{:06}", names_.size());
    names_[target.string()] = archive_ + "/" + printable_line(entry.name);
    unpack(zip.get(), entry, target, names_[target.string()]);
    progress.advance();
  }
}

std::string UnpackedZip::renamed(std::string message) const {
  const std::string ours = folder().string();
  for (std::size_t at = message.find(ours); at != std::string::npos; at = message.find(ours, at)) {
    constexpr std::size_t kOwnName = std::string_view("/000000/000000").size();
    const auto name = names_.find(message.substr(at, ours.size() + kOwnName));
    const std::string& theirs = name == names_.end() ? archive_ : name->second;
    message.replace(at, name == names_.end() ? ours.size() : name->first.size(), theirs);
    at += theirs.size();
  }
  return message;
}

bool is_zip(const std::string& leading_bytes) {
  return leading_bytes.starts_with(std::string_view("PK\3\4", 4));
}

}  // namespace xraycast
