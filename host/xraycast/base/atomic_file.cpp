#include "xraycast/base/atomic_file.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fcntl.h>
#include <iterator>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <string>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

namespace fs = std::filesystem;

std::atomic<int> written{0};

/// Which files this process has, and whether more of them get their names.
struct Outputs {
  std::mutex mutex;  ///< held while files are made and get their names
  std::set<fs::path> temporaries;
  int series = 0;
  bool are_complete = false, are_closed = false;

  void require_open() const {
    if (are_closed) throw Cancelled();
  }
};

Outputs& outputs() {
  static Outputs& all = *new Outputs;  // threads may outlive static objects
  return all;
}

bool is_full_disk(int reason) { return reason == ENOSPC || reason == EDQUOT || reason == EFBIG; }

Error failure_of(const fs::path& target, int reason, std::int64_t needed_B) {
  std::string line = target.string() + ": could not be written completely";
  if (reason != 0) line += fmt::format(" ({})", std::strerror(reason));
  if (reason == 0 || is_full_disk(reason))
    line += "; the disk may be full: make room " +
            (needed_B > 0 ? fmt::format("for {:.3g} MB", static_cast<double>(needed_B) / 1e6) : "on it");
  return Error("{}", line);
}

/// An open file that is closed at the end.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  int operator()() const { return number_; }
  /// False, with errno, when the file system could not take what was written.
  bool close() { return ::close(std::exchange(number_, -1)) == 0; }

 private:
  int number_;
};

/// False, with errno, when not all was written.
bool write_all(int file, const char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t done = write(file, bytes, count);
    if (done < 0 && errno != EINTR) return false;
    if (done <= 0) continue;
    bytes += done;
    count -= static_cast<std::size_t>(done);
  }
  return true;
}

// ---- resolving a target's name --------------------------------------------------------------------

struct Place {
  fs::path file;                    ///< the file itself, behind all links
  std::optional<mode_t> mode{};     ///< the permissions of the one that is replaced
  bool is_stream = false;           ///< is written to, not replaced
  std::optional<int> descriptor{};  ///< the descriptor under which this process has the stream open
};

fs::path folder_of(const fs::path& path) { return path.has_parent_path() ? path.parent_path() : "."; }

/// N where the path leads to /proc/self/fd/N, as /dev/stdout and /dev/fd/N do.
std::optional<int> own_descriptor(fs::path path) {
  const fs::path descriptors = fmt::format("/proc/{}/fd", getpid());
  constexpr int kMaxLinks = 8;
  std::error_code error;
  for (int link = 0; link < kMaxLinks; ++link) {
    const fs::path folder = fs::canonical(folder_of(path), error);
    if (error) return std::nullopt;
    if (folder == descriptors) {
      const std::string name = path.filename().string();
      int number = -1;
      std::from_chars(name.data(), name.data() + name.size(), number);
      return number;
    }
    const fs::path next = fs::read_symlink(path, error);
    if (error) return std::nullopt;
    path = folder / next;
  }
  return std::nullopt;
}

Place place_of(const fs::path& target) {
  if (target.filename().empty()) throw InputError("{}: not a file name", target.string());
  if (const auto descriptor = own_descriptor(target)) {
    const int flags = fcntl(*descriptor, F_GETFL);
    if (flags < 0 || (flags & O_ACCMODE) == O_RDONLY)
      throw InputError("{}: is not open for writing", target.string());
    return {.file = target, .is_stream = true, .descriptor = descriptor};
  }
  std::error_code error;
  Place place{.file = target};
  const bool is_link = fs::is_symlink(fs::symlink_status(target, error));
  if (is_link) {
    place.file = fs::canonical(target, error);
    if (error)
      throw InputError("{}: a dangling symbolic link ({}); remove it or choose another output name",
                       target.string(), error.message());
  }
  struct stat status {};
  if (stat(place.file.c_str(), &status) != 0) return place;
  place.is_stream = !is_link && (S_ISFIFO(status.st_mode) || S_ISCHR(status.st_mode));
  if (!place.is_stream && !S_ISREG(status.st_mode))
    throw InputError("{}: not a regular file, so it is not replaced; choose another output name",
                     target.string());
  if (place.is_stream && access(place.file.c_str(), W_OK) != 0)
    throw InputError("{}: cannot be written: {}", target.string(), std::strerror(errno));
  place.mode = status.st_mode & 0777;
  return place;
}

// ---- temporary names --------------------------------------------------------------------------------

/// `.NAME.0123456789abcdef.part.EXTENSIONS`
class TemporaryName {
 public:
  explicit TemporaryName(const fs::path& file) {
    // Everything from the first dot on, so that `a.nii.gz` keeps both: writers choose the format by it.
    const std::string name = file.filename().string();
    const auto dot = std::min(name.find('.', 1), name.size());
    std::string stem = name.substr(0, dot), extensions = name.substr(dot);
    // A name may have 255 bytes. If the extensions are too long, only the last one is kept.
    constexpr std::size_t kMaxExtensions = 180, kMost = 220;
    if (extensions.size() > kMaxExtensions) extensions = fs::path(extensions).extension().string();
    if (extensions.size() > kMaxExtensions) extensions.clear();
    stem.resize(std::min(stem.size(), kMost - extensions.size()));
    before_ = '.' + stem + '.';
    after_ = ".part" + extensions;
  }

  std::string any() const {
    std::random_device random;
    return fmt::format("{}{:08x}{:08x}{}", before_, random(), random(), after_);
  }
  bool fits(const std::string& name) const {
    return name.size() == before_.size() + kDigits + after_.size() && name.starts_with(before_) &&
           name.ends_with(after_) &&
           name.find_first_not_of("0123456789abcdef", before_.size()) == before_.size() + kDigits;
  }

 private:
  static constexpr std::size_t kDigits = 16;
  std::string before_, after_;
};

/// The flags for opening a leftover file or folder to lock it.
enum class Leftover { file = O_RDWR | O_NONBLOCK, folder = O_RDONLY | O_DIRECTORY };

/// Removes the leftovers of processes that died while writing: nobody holds their lock any more.
void remove_leftovers(const fs::path& folder, const TemporaryName& names, Leftover kind) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (!names.fits(entry->path().filename().string())) continue;
    const Descriptor left(open(entry->path().c_str(), static_cast<int>(kind) | O_NOFOLLOW | O_CLOEXEC));
    std::error_code ignored;
    if (left() >= 0 && flock(left(), LOCK_EX | LOCK_NB) == 0) fs::remove_all(entry->path(), ignored);
  }
}

/// A name without the slash that it may end in.
fs::path without_slash(const fs::path& folder) {
  return folder.has_filename() ? folder : folder.parent_path();
}

/// Removes a temporary file or folder unless it has got its name.
void forget(const fs::path& temporary, bool is_published) {
  const std::lock_guard lock(outputs().mutex);
  std::error_code ignored;
  if (!is_published) fs::remove_all(temporary, ignored);
  outputs().temporaries.erase(temporary);
}

}  // namespace

// ---- a temporary file -------------------------------------------------------------------------------

class AtomicFile::Temporary {
 public:
  explicit Temporary(fs::path target) : target_(std::move(target)), place_(place_of(target_)) {
    std::error_code error;
    const fs::path folder = place_.is_stream ? fs::temp_directory_path() : folder_of(place_.file);
    if (!fs::is_directory(folder, error)) {
      if (error && error != std::errc::no_such_file_or_directory && error != std::errc::not_a_directory)
        throw InputError("{}: cannot be written: {}", target_.string(), error.message());
      throw InputError("{}: the output folder does not exist; create it first", folder.string());
    }
    const TemporaryName names(place_.file);
    remove_leftovers(folder, names, Leftover::file);
    const std::lock_guard lock(outputs().mutex);
    outputs().require_open();
    create(folder, names);
    outputs().temporaries.insert(name_);
  }
  ~Temporary() { forget(name_, is_published_); }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

  const fs::path& name() const { return name_; }
  bool write(std::string_view bytes) const { return write_all(file_(), bytes.data(), bytes.size()); }

  /// Flushes to the disk: some file systems report only now that it is full.
  void sync() const {
    if (place_.is_stream) return;
    if (place_.mode) fchmod(file_(), *place_.mode);
    // Not every file system can; errors on closing a descriptor are detected without giving up the lock.
    if ((fsync(file_()) != 0 && errno != EINVAL && errno != ENOSYS && errno != EOPNOTSUPP) ||
        !Descriptor(dup(file_())).close()) {
      const int reason = errno;
      struct stat status {};
      throw failure_of(target_, reason, fstat(file_(), &status) == 0 ? status.st_size : 0);
    }
  }

  /// Under the targets' names: all, or none when the process was told to end before.
  static void publish(std::span<const std::unique_ptr<Temporary>> files) {
    // Those who read a stream take any time, which nobody who waits for the mutex has.
    for (const auto& file : files)
      if (file->place_.is_stream) file->copy_to_stream();
    const std::lock_guard lock(outputs().mutex);
    outputs().require_open();
    for (const auto& file : files)
      if (file->place_.is_stream)
        ++written;
      else
        file->rename();
    outputs().are_complete |= outputs().series == 0;
  }

 private:
  void create(const fs::path& folder, const TemporaryName& names) {
    // The replacement of a private file is never readable by others.
    const mode_t mode = place_.is_stream || place_.mode ? 0600 : 0666;
    struct stat status {};
    do {
      name_ = folder / names.any();
      file_ = Descriptor(open(name_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, mode));
      if (file_() < 0 && is_full_disk(errno)) throw failure_of(target_, errno, 0);
      if (file_() < 0) throw InputError("{}: cannot be written: {}", target_.string(), std::strerror(errno));
      flock(file_(), LOCK_EX);  // on file systems without locks, nobody treats it as a leftover either
      // Until locked, it looked like a leftover.
    } while (lstat(name_.c_str(), &status) != 0);
  }

  void rename() {
    if (::rename(name_.c_str(), place_.file.c_str()) != 0)
      throw Error("{}: could not be renamed into place: {}", target_.string(), std::strerror(errno));
    is_published_ = true;
    ++written;
    // A folder that cannot be opened for reading cannot be synced; the file is there all the same.
    const Descriptor folder(open(folder_of(place_.file).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder() >= 0 && fsync(folder()) != 0 && (errno == EIO || is_full_disk(errno)))
      throw failure_of(target_, errno, 0);
  }

  void copy_to_stream() {
    Descriptor stream(place_.descriptor ? dup(*place_.descriptor)
                                        : open(place_.file.c_str(), O_WRONLY | O_NOCTTY | O_CLOEXEC));
    const auto check = [this](bool is_done) {
      if (!is_done) throw failure_of(target_, errno, 0);
    };
    check(stream() >= 0 && lseek(file_(), 0, SEEK_SET) == 0);
    std::array<char, 65536> buffer;
    ssize_t count = 0;
    while ((count = read(file_(), buffer.data(), buffer.size())) > 0)
      check(write_all(stream(), buffer.data(), static_cast<std::size_t>(count)));
    check(count == 0 && stream.close());
  }

  fs::path target_;
  Place place_;
  fs::path name_;
  Descriptor file_;
  bool is_published_ = false;
};

// ---- public functions -------------------------------------------------------------------------------

namespace {
thread_local OutputSet* open_set = nullptr;
}

AtomicFile::AtomicFile(fs::path target)
    : target_(std::move(target)), temporary_(std::make_unique<Temporary>(target_)) {}

AtomicFile::~AtomicFile() = default;

const fs::path& AtomicFile::temporary() const { return temporary_->name(); }

void AtomicFile::write(std::string_view bytes, std::int64_t needed_B) {
  if (!temporary_->write(bytes)) throw failure(errno, needed_B);
}

Error AtomicFile::failure(int reason, std::int64_t needed_B) const {
  return failure_of(target_, reason, needed_B);
}

void AtomicFile::commit() {
  temporary_->sync();
  if (open_set) return open_set->files_.push_back(std::move(temporary_));
  const auto file = std::exchange(temporary_, nullptr);
  Temporary::publish({&file, 1});
}

OutputSet::OutputSet() : outer_(std::exchange(open_set, this)) {}

OutputSet::~OutputSet() { open_set = outer_; }

void OutputSet::commit() {
  if (outer_)
    std::ranges::move(files_, std::back_inserter(outer_->files_));
  else
    AtomicFile::Temporary::publish(files_);
  files_.clear();
}

OutputSeries::OutputSeries() {
  const std::lock_guard lock(outputs().mutex);
  ++outputs().series;
}

OutputSeries::~OutputSeries() {
  const std::lock_guard lock(outputs().mutex);
  --outputs().series;
}

// ---- a temporary folder -----------------------------------------------------------------------------

class AtomicFolder::Temporary {
 public:
  explicit Temporary(const fs::path& target) {
    std::error_code error;
    const fs::path above = folder_of(target);
    if (!fs::is_directory(above, error))
      throw InputError("{}: the output folder does not exist; create it first", above.string());
    if (fs::exists(fs::symlink_status(target, error)) &&
        !(fs::is_directory(fs::symlink_status(target, error)) && fs::is_empty(target, error)))
      throw InputError("{}: exists already and is not an empty folder; choose another name or remove it",
                       target.string());
    const TemporaryName names(target);
    remove_leftovers(above, names, Leftover::folder);
    const std::lock_guard lock(outputs().mutex);
    outputs().require_open();
    name_ = above / names.any();
    if (mkdir(name_.c_str(), 0777) != 0) {
      if (is_full_disk(errno)) throw failure_of(target, errno, 0);
      throw InputError("{}: cannot be written: {}", target.string(), std::strerror(errno));
    }
    lock_ = Descriptor(open(name_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    flock(lock_(), LOCK_EX);
    outputs().temporaries.insert(name_);
  }
  ~Temporary() { forget(name_, is_published_); }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

  /// A new file in it, or none, with errno.
  Descriptor add(const std::string& name) const {
    const std::lock_guard lock(outputs().mutex);
    outputs().require_open();
    return Descriptor(
        open((name_ / name).c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
  }

  /// False, with errno, when it cannot be renamed.
  bool publish(const fs::path& target) {
    if (fsync(lock_()) != 0) return false;
    const std::lock_guard lock(outputs().mutex);
    outputs().require_open();
    if (::rename(name_.c_str(), target.c_str()) != 0) return false;
    is_published_ = true;
    ++written;
    outputs().are_complete |= outputs().series == 0;
    const Descriptor above(open(folder_of(target).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (above() >= 0) fsync(above());
    return true;
  }

 private:
  fs::path name_;
  Descriptor lock_;
  bool is_published_ = false;
};

AtomicFolder::AtomicFolder(fs::path target)
    : target_(without_slash(target)), temporary_(std::make_unique<Temporary>(target_)) {}

AtomicFolder::~AtomicFolder() = default;

void AtomicFolder::write(const std::string& name, std::initializer_list<std::string_view> parts,
                         std::int64_t needed_B) const {
  Descriptor file = temporary_->add(name);
  const auto check = [&](bool is_done) {
    if (!is_done) throw failure_of(target_ / name, errno, needed_B);
  };
  check(file() >= 0);
  for (const std::string_view part : parts) check(write_all(file(), part.data(), part.size()));
  check(fsync(file()) == 0);
  check(file.close());
}

void AtomicFolder::commit() {
  if (!temporary_->publish(target_))
    throw Error("{}: could not be renamed into place: {}", target_.string(), std::strerror(errno));
  temporary_.reset();
}

// ---- a process that is told to end ------------------------------------------------------------------

int files_written() { return written; }

bool close_outputs() {
  const std::lock_guard lock(outputs().mutex);
  if (outputs().are_complete) return false;
  if (outputs().series == 0) outputs().are_closed = true;
  return true;
}

void keep_outputs() {
  const std::lock_guard lock(outputs().mutex);
  outputs().are_complete = true;
}

bool abandon_outputs() {
  const std::lock_guard lock(outputs().mutex);
  if (outputs().are_complete) return false;
  outputs().are_closed = true;
  std::error_code ignored;
  for (const fs::path& temporary : outputs().temporaries) fs::remove_all(temporary, ignored);
  return true;
}

}  // namespace xraycast
