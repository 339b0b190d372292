#include "rtk.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace xraycast::bench {
namespace {

nlohmann::json json_of(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

}  // namespace

RtkProjector::RtkProjector(const std::filesystem::path& python, const std::filesystem::path& scan) {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw std::runtime_error("no socket to talk to Python over");
  const std::string interpreter = python.string(), script = XRAYCAST_BENCH_SOURCE_DIR "/rtk_project.py",
                    file = scan.string();
  process_ = fork();
  if (process_ == 0) {
    dup2(ends[1], STDIN_FILENO);
    dup2(ends[1], STDOUT_FILENO);
    execl(interpreter.c_str(), interpreter.c_str(), script.c_str(), file.c_str(), nullptr);
    _exit(127);
  }
  close(ends[1]);
  socket_ = ends[0];
  std::string said;
  try {
    said = line();
  } catch (const std::runtime_error&) {
    said = fmt::format("{} does not run", interpreter);
  }
  if (said == "ready") return;
  close(socket_);
  waitpid(process_, nullptr, 0);
  throw std::runtime_error(said);
}

RtkProjector::~RtkProjector() {
  close(socket_);  // ends its loop
  waitpid(process_, nullptr, 0);
}

RtkProjector::Picture RtkProjector::project(const View& view) {
  const glm::dvec3 middle_mm = view.pixel_on_detector_mm(0.5 * (view.width - 1), 0.5 * (view.height - 1));
  const nlohmann::json request{{"source", json_of(view.source_mm())},
                               {"middle", json_of(middle_mm)},
                               {"right", json_of(view.right())},
                               {"down", json_of(-view.up())},
                               {"width", view.width},
                               {"height", view.height},
                               {"pixel_mm", view.pixel_mm}};
  const std::string text = request.dump() + '\n';
  if (send(socket_, text.data(), text.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(text.size()))
    throw std::runtime_error("RTK's process has ended");
  Picture picture{std::stod(line()), {}};
  picture.tau.resize(static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height));
  read(picture.tau.data(), picture.tau.size() * sizeof(float));
  return picture;
}

std::string RtkProjector::line() {
  std::string text;
  for (char c = 0; read(&c, 1), c != '\n';) text += c;
  return text;
}

void RtkProjector::read(void* to, std::size_t bytes) {
  for (std::size_t done = 0; done < bytes;) {
    const ssize_t got = ::read(socket_, static_cast<char*>(to) + done, bytes - done);
    if (got <= 0) throw std::runtime_error("RTK's process has ended");
    done += static_cast<std::size_t>(got);
  }
}

double psnr_db(const std::vector<float>& picture, const std::vector<float>& truth) {
  double squared = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) squared += std::pow(picture[i] - truth[i], 2);
  const double peak = *std::ranges::max_element(truth);
  return 10 * std::log10(peak * peak / (squared / static_cast<double>(truth.size())));
}

}  // namespace xraycast::bench
