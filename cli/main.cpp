#include "options/command.hpp"
#include "progress_bar.hpp"
#include "signals.hpp"
#include "usage_hint.hpp"
#include "xraycast/base/error.hpp"
#include "xraycast/base/memory_limit.hpp"
#include "xraycast/base/stderr_log.hpp"
#include "xraycast/opencl/failure_in_words.hpp"
#include "xraycast/opencl/kernel_cache.hpp"

#include <csignal>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <malloc.h>
#include <new>
#include <poll.h>
#include <unistd.h>

namespace {

using namespace xraycast;

// Exit statuses; scripts rely on them. After a signal: 128 + its number, as in a shell.
enum Status { kDone = 0, kFailed = 1, kWrongUsage = 2, kBadInput = 3, kDeviceFailed = 4 };

/// One line, whatever the message holds.
int report(const std::string& what, int status) {
  log_to_stderr(what);
  return status;
}

int report_cancelled() {
  return report(cli::cancelled_in_words(), cli::kSignalStatus + cli::SignalWatch::caught());
}

/// Reports the exception that is being handled.
int report_failure() {
  try {
    rethrow_in_words();
  } catch (const InputError& error) {
    return report(error.what(), kBadInput);
  } catch (const DeviceError& error) {
    return report(error.what(), kDeviceFailed);
  } catch (const std::bad_alloc&) {
    return report("not enough memory", kFailed);
  } catch (const std::exception& error) {
    return report(error.what(), kFailed);
  }
}

/// The one place where errors become exit statuses.
int run(const std::function<void()>& job, cli::SignalWatch& signals) {
  try {
    job();
    signals.end_job();
    return kDone;
  } catch (const Cancelled&) {
    signals.end_job();
    return report_cancelled();
  } catch (...) {
    signals.end_job();
    // After a signal, other failures are most likely its consequence.
    return cli::SignalWatch::caught() != 0 ? report_cancelled() : report_failure();
  }
}

/// Standard output may be a full disk or a closed pipe.
int checked_output(int status) {
  std::cout.flush();
  if (std::cout || status != kDone) return status;
  pollfd out{STDOUT_FILENO, POLLOUT, 0};
  if (poll(&out, 1, 0) == 1 && (out.revents & POLLERR) != 0) return cli::kSignalStatus + SIGPIPE;
  return report("standard output could not be written; the disk may be full", kFailed);
}

/// Before any thread starts and any library is loaded.
void save_address_space() {
  // OpenBLAS comes with OpenCV, which does not call it. It would start a thread a core, and where there is no
  // memory for them it waits without end.
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  // Each thread's heap reserves 64 MB otherwise.
  if (address_space_left().is_limited()) mallopt(M_ARENA_MAX, 1);
}

}  // namespace

int main(int argc, char** argv) {
  save_address_space();
  CLI::App app{"xraycast turns CT scans into fluoroscopy that one can fly through. Not for clinical use.",
               "xraycast"};
  app.set_version_flag("--version", XRAYCAST_VERSION);
  app.require_subcommand(0,
                         1);  // a missing one is reported below: CLI11 would report a misspelt one as missing
  app.fallthrough();          // global options are accepted after the subcommand too
  app.get_formatter()->column_width(34);

  cli::ProgressBar* bar = nullptr;
  cli::Invocation invocation([&bar](const Progress::State& state) { bar->show(state); });
  cli::SignalWatch signals(invocation.progress);
  app.add_option("--device", invocation.device,
                 "OpenCL device, by number or part of its name (see `xraycast devices`)")
      ->type_name("NAME");
  app.add_flag("--json", invocation.json, "Print results as JSON on stdout");
  app.add_flag("--quiet,-q", invocation.quiet,
               "Suppress notes, warnings, progress and the report of written files");
  cli::add_info(app, invocation);
  cli::add_convert(app, invocation);
  cli::add_phantom(app, invocation);
  cli::add_cast(app, invocation);
  cli::add_recast(app, invocation);
  cli::add_project(app, invocation);
  cli::add_segment(app, invocation);
  cli::add_vessels(app, invocation);
  cli::add_edit(app, invocation);
  cli::add_motion(app, invocation);
  cli::add_register(app, invocation);
  cli::add_vesselness(app, invocation);
  cli::add_render(app, invocation);
  cli::add_compare(app, invocation);
  cli::add_flow(app, invocation);
  cli::add_simulate(app, invocation);
  cli::add_report(app, invocation);
  cli::add_export(app, invocation);
  cli::add_view(app, invocation);
  cli::add_serve(app, invocation);
  cli::add_devices(app, invocation);
  cli::add_demo(app, invocation);

  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return checked_output(app.exit(help));
  } catch (const CLI::ParseError& error) {
    return report(std::string(error.what()) + " (" + cli::usage_hint(app) + ")", kWrongUsage);
  }
  if (!invocation.job) return report("a subcommand is required (see `xraycast --help`)", kWrongUsage);
  const KernelCache kernel_cache;
  const int status = run(
      [&] {
        // Destroyed, and its line removed, before an error is reported.
        cli::ProgressBar drawn(!invocation.quiet);
        bar = &drawn;
        invocation.job();
      },
      signals);
  const int written = checked_output(status);
  return written == kDone && invocation.is_ended_by_signal ? cli::kSignalStatus + cli::SignalWatch::caught()
                                                           : written;
}
