#include "support/process.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <sstream>
#include <stdexcept>
#include <sys/resource.h>
#include <sys/wait.h>
#include <system_error>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

void check(int result, const char* what) {
  if (result < 0) throw std::system_error(errno, std::generic_category(), what);
}

std::vector<std::string> environment_with(const std::map<std::string, std::string>& changes) {
  std::vector<std::string> all;
  for (char** entry = environ; *entry; ++entry) {
    const std::string text = *entry;
    if (!changes.contains(text.substr(0, text.find('=')))) all.push_back(text);
  }
  for (const auto& [name, value] : changes) all.push_back(name + '=' + value);
  return all;
}

/// As exec takes it; the pointers live as long as `strings`.
std::vector<char*> pointers_to(std::vector<std::string>& strings) {
  std::vector<char*> pointers;
  for (std::string& text : strings) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

Command command_of(std::vector<std::string> words, const std::string& line,
                   const std::filesystem::path& folder) {
  Command command{std::move(words)};
  std::istringstream stream(line);
  for (std::string word; stream >> word; command.words.push_back(word))
    for (std::size_t at; (at = word.find('@')) != std::string::npos;) word.replace(at, 1, folder.string());
  return command;
}

Process::Process(const Command& command)
    : deadline_(Clock::now() + command.patience), name_(command.words.front()) {
  std::vector<std::string> words = command.words, variables = environment_with(command.environment);
  const std::vector<char*> arguments = pointers_to(words), environment = pointers_to(variables);
  const rlimit limit{command.largest_file_B.value_or(RLIM_INFINITY), RLIM_INFINITY};
  std::array<int, 2> out{}, err{};
  check(pipe2(out.data(), O_CLOEXEC), "pipe2");
  if (command.on_terminal)
    check(openpty(&err[0], &err[1], nullptr, nullptr, nullptr), "openpty");
  else
    check(pipe2(err.data(), O_CLOEXEC), "pipe2");

  id_ = fork();
  check(id_, "fork");
  if (id_ == 0) {  // until exec, only what is safe after a fork
    const int nothing = open("/dev/null", O_RDONLY);
    dup2(nothing, STDIN_FILENO);
    dup2(out[1], STDOUT_FILENO);
    dup2(err[1], STDERR_FILENO);
    if (command.on_terminal) {
      close(err[0]);
      close(err[1]);
    }
    setrlimit(RLIMIT_FSIZE, &limit);
    // A write beyond the limit then fails, as on a full disk, and does not kill.
    if (command.largest_file_B) std::signal(SIGXFSZ, SIG_IGN);
    execve(arguments[0], arguments.data(), environment.data());
    _exit(127);
  }
  close(out[1]);
  close(err[1]);
  streams_[0].file = out[0];
  streams_[1].file = err[0];
}

Process::~Process() {
  for (const Stream& stream : streams_)
    if (stream.file >= 0) close(stream.file);
  if (id_ < 0) return;
  kill(id_, SIGKILL);
  waitpid(id_, nullptr, 0);
}

void Process::fail(const std::string& why) const {
  throw std::runtime_error(name_ + why + "\nstdout: " + streams_[0].text + "\nstderr: " + streams_[1].text);
}

bool Process::listen() {
  std::array<pollfd, 2> polled{};
  for (std::size_t i = 0; i < polled.size(); ++i) polled[i] = {streams_[i].file, POLLIN, 0};
  if (std::ranges::all_of(polled, [](const pollfd& p) { return p.fd < 0; })) return false;
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline_ - Clock::now());
  if (left.count() <= 0) fail(" does not end");
  check(poll(polled.data(), polled.size(), static_cast<int>(left.count())), "poll");
  for (std::size_t i = 0; i < polled.size(); ++i) {
    if (polled[i].revents == 0) continue;
    std::array<char, 4096> buffer;
    const ssize_t count = read(streams_[i].file, buffer.data(), buffer.size());
    if (count > 0) {
      streams_[i].text.append(buffer.data(), static_cast<std::size_t>(count));
    } else {  // a terminal that was hung up reports an error, a pipe 0
      close(streams_[i].file);
      streams_[i].file = -1;
    }
  }
  return true;
}

void Process::wait_for(const std::string& text) {
  while (streams_[1].text.find(text) == std::string::npos)
    if (!listen()) fail(" ended without saying '" + text + "'");
}

void Process::send(int signal) const { check(kill(id_, signal), "kill"); }

Finished Process::finish() {
  while (listen()) {
  }
  int status = 0;
  check(waitpid(id_, &status, 0), "waitpid");
  id_ = -1;
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), streams_[0].text,
          streams_[1].text};
}

}  // namespace xraycast
