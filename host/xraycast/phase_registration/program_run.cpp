#include "xraycast/phase_registration/program_run.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/plain_text.hpp"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

/// A pipe that other programs do not inherit.
class Pipe {
 public:
  Pipe() {
    if (pipe2(ends_.data(), O_CLOEXEC) != 0)
      throw Error("no program can be started: {}; close other programs", std::strerror(errno));
  }
  ~Pipe() {
    close_reading();
    close_writing();
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;

  int reading() const { return ends_[0]; }
  int writing() const { return ends_[1]; }
  void close_writing() { close_end(ends_[1]); }

 private:
  static void close_end(int& end) {
    if (const int open_end = std::exchange(end, -1); open_end >= 0) close(open_end);
  }
  void close_reading() { close_end(ends_[0]); }

  std::array<int, 2> ends_{-1, -1};
};

/// In the new process, between fork and exec: only what is safe in a copy of a process with threads.
[[noreturn]] void become(char* const* arguments, const Pipe& output, const Pipe& failure) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGTERM}) std::signal(signal, SIG_DFL);
  std::signal(SIGINT, SIG_IGN);
  if (const int nothing = open("/dev/null", O_RDONLY); nothing >= 0) dup2(nothing, STDIN_FILENO);
  dup2(output.writing(), STDOUT_FILENO);
  dup2(output.writing(), STDERR_FILENO);
  execvp(arguments[0], arguments);
  const int error = errno;
  [[maybe_unused]] const auto told = write(failure.writing(), &error, sizeof error);
  _exit(127);
}

/// A process that ends with this object.
class Child {
 public:
  explicit Child(pid_t process) : process_(process) {}
  ~Child() {
    if (process_ <= 0) return;
    kill(process_, SIGKILL);
    wait();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Its exit status, or 128 + the signal that ended it.
  int wait() {
    int status = 0;
    while (waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    process_ = 0;
    return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  }

 private:
  pid_t process_;
};

/// Whole lines of what comes piece by piece.
class Lines {
 public:
  explicit Lines(const std::function<void(std::string_view)>& listener) : listener_(listener) {}

  void add(std::string_view piece) {
    begun_ += piece;
    std::string_view left = begun_;
    while (left.find('\n') != std::string_view::npos) listener_(take_line(left));
    begun_ = std::string(left);
  }
  void finish() {
    if (!begun_.empty()) listener_(begun_);
  }

 private:
  const std::function<void(std::string_view)>& listener_;
  std::string begun_;
};

void read_lines(int from, Lines& lines, const Progress& progress) {
  constexpr int kPatience_ms = 100;
  std::array<char, 4096> piece;
  for (;;) {
    progress.check();
    pollfd waited{from, POLLIN, 0};
    if (poll(&waited, 1, kPatience_ms) <= 0) continue;
    const ssize_t size = read(from, piece.data(), piece.size());
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return lines.finish();
    lines.add({piece.data(), static_cast<std::size_t>(size)});
  }
}

}  // namespace

std::optional<int> run_program(const std::vector<std::string>& command,
                               const std::function<void(std::string_view line)>& listener,
                               const Progress& progress) {
  std::vector<std::string> words = command;
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  Pipe output, failure;
  const pid_t process = fork();
  if (process < 0) throw Error("no program can be started: {}; close other programs", std::strerror(errno));
  if (process == 0) become(arguments.data(), output, failure);
  Child child(process);
  output.close_writing();
  failure.close_writing();
  int error = 0;
  ssize_t size = 0;
  while ((size = read(failure.reading(), &error, sizeof error)) < 0 && errno == EINTR) {
  }
  if (size > 0 && error == ENOENT) return {};
  if (size > 0) throw Error("{} cannot be started: {}", command.front(), std::strerror(error));
  Lines lines(listener);
  read_lines(output.reading(), lines, progress);
  return child.wait();
}

}  // namespace xraycast
