#include "options/command.hpp"
#include "xraycast/base/error.hpp"

#include <fmt/format.h>

namespace xraycast::cli {
namespace {

/// A subcommand that takes any arguments and says where it is to be had.
void add_left_out(CLI::App& app, Invocation& invocation, const char* name, const char* what) {
  const auto refuse = [name, what] {
    throw Error("{}: Python wheels leave {} out; install Debian's package xraycast", name, what);
  };
  add_command(app, invocation, name, fmt::format("In Debian's package: {} is left out here", what),
              fmt::format("  xraycast {} map.exr --vessels vessels", name), refuse)
      ->fallthrough(false)  // else the program would look at them
      ->allow_extras();
}

}  // namespace

void add_view(CLI::App& app, Invocation& invocation) { add_left_out(app, invocation, "view", "the window"); }

void add_serve(CLI::App& app, Invocation& invocation) {
  add_left_out(app, invocation, "serve", "the server");
}

}  // namespace xraycast::cli
