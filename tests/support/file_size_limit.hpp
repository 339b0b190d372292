#pragma once

#include <csignal>
#include <sys/resource.h>

namespace xraycast {

/// Stands for a full disk: for as long as it lives, no file of this process grows beyond `most_B`.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t most_B) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit small{most_B, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int);
};

}  // namespace xraycast
