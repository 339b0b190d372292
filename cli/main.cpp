#include "command.hpp"
#include "progress_bar.hpp"
#include "usage_hint.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/opencl/compute_device.hpp"

#include <csignal>
#include <exception>
#include <iostream>
#include <new>

namespace {

using namespace xraycast;

// Exit statuses; scripts rely on them.
enum Status { kDone = 0, kFailed = 1, kWrongUsage = 2, kBadInput = 3, kDeviceFailed = 4, kInterrupted = 130 };

Progress* interruptible = nullptr;

/// The first Ctrl-C lets the job clean up; a second one ends the process at once.
void interrupt(int) {
  if (interruptible) interruptible->cancel();
  std::signal(SIGINT, SIG_DFL);
}

/// One line, whatever the message holds.
int report(const std::string& what, Status status) {
  std::string line = "xraycast: " + what;
  for (char& c : line)
    if (c == '\n' || c == '\r') c = ' ';
  std::cerr << line << '\n';
  return status;
}

/// The one place where errors become exit statuses.
int run(const std::function<void()>& job) {
  try {
    job();
    return kDone;
  } catch (const Cancelled&) {
    return report("cancelled; no output was written", kInterrupted);
  } catch (const InputError& error) {
    return report(error.what(), kBadInput);
  } catch (const DeviceError& error) {
    return report(error.what(), kDeviceFailed);
  } catch (const cl::Error& error) {
    return report(std::string(error.what()) + " failed with " + status_name(error.err()), kDeviceFailed);
  } catch (const std::bad_alloc&) {
    return report("not enough memory", kFailed);
  } catch (const std::exception& error) {
    return report(error.what(), kFailed);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"xraycast turns CT scans into fluoroscopy that one can fly through. Not for clinical use.",
               "xraycast"};
  app.set_version_flag("--version", XRAYCAST_VERSION);
  app.require_subcommand(0, 1);  // none is told below: CLI11 would take a misspelt one for none
  app.fallthrough();             // global options are taken behind the subcommand too
  app.get_formatter()->column_width(34);

  cli::ProgressBar* bar = nullptr;
  cli::Session session([&bar](const Progress::State& state) { bar->show(state); });
  app.add_option("--device", session.device,
                 "OpenCL device, by number or part of its name (see `xraycast devices`)")
      ->type_name("NAME");
  app.add_flag("--json", session.json, "Machine-readable results on stdout");
  app.add_flag("--quiet,-q", session.quiet, "No notes, no progress, and no word of files that were written");
  cli::add_info(app, session);
  cli::add_phantom(app, session);
  cli::add_cast(app, session);
  cli::add_recast(app, session);
  cli::add_project(app, session);
  cli::add_segment(app, session);
  cli::add_vesselness(app, session);
  cli::add_render(app, session);
  cli::add_compare(app, session);
  cli::add_simulate(app, session);
  cli::add_view(app, session);
  cli::add_devices(app, session);
  cli::add_demo(app, session);

  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    return report(std::string(error.what()) + " (" + cli::usage_hint(app) + ")", kWrongUsage);
  }
  if (!session.job) return report("a subcommand is required (see `xraycast --help`)", kWrongUsage);
  interruptible = &session.progress;
  std::signal(SIGINT, interrupt);
  std::signal(SIGTERM, interrupt);
  return run([&] {
    // Gone, and its line with it, before an error is reported.
    cli::ProgressBar drawn(!session.quiet);
    bar = &drawn;
    session.job();
  });
}
