#include "xraycast/simulation/simulation_loop.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/base/stopwatch.hpp"
#include "xraycast/contrast_agent/agent_outlet.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <utility>

namespace xraycast {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kBins_per_ms = 100;
constexpr std::size_t kBins = 2000;  // the last one: longer than 20 ms
constexpr auto kMaxDelay = std::chrono::milliseconds(100);
// Evaluating the histogram takes microseconds, negligible once in so many steps.
constexpr std::int64_t kSummary_steps = 100;

double percentile_ms(const std::vector<std::int64_t>& histogram, std::int64_t total, double part) {
  const auto wanted = static_cast<std::int64_t>(std::ceil(part * static_cast<double>(total)));
  std::int64_t below = 0;
  std::size_t bin = 0;
  while (bin + 1 < histogram.size() && (below += histogram[bin]) < wanted) ++bin;
  return static_cast<double>(bin + 1) / kBins_per_ms;
}

/// Real-time priority: a deadline of a millisecond is easily missed.
void raise_priority() {
  const sched_param priority{.sched_priority = 1};
  if (pthread_setschedparam(pthread_self(), SCHED_RR, &priority) == 0) return;
  // Without that permission, short time slices, which are scheduled sooner. Linux honours them since 6.12 and
  // ignores them before. The kernel's struct sched_attr, which this C library does not declare:
  struct {
    std::uint32_t size = 48, policy = SCHED_OTHER;
    std::uint64_t flags = 0;
    std::int32_t nice = getpriority(PRIO_PROCESS, 0);  // unchanged
    std::uint32_t priority = 0;
    std::uint64_t runtime_ns = 100'000, deadline_ns = 0, period_ns = 0;
  } attributes;
  syscall(SYS_sched_setattr, 0, &attributes, 0U);
}

}  // namespace

SimulationLoop::SimulationLoop(std::unique_ptr<Instruments> instruments, Hand hand, Exchanged exchanged,
                               Body body, Watch watch)
    : instruments_(std::move(instruments)),
      hand_(std::move(hand)),
      exchanged_(std::move(exchanged)),
      body_(std::move(body)),
      watch_(std::move(watch)),
      hubs_(instruments_->count()),
      loads_(instruments_->count()),
      histogram_(kBins, 0) {
  next_.inner.resize(instruments_->count() - 1);
  list_instruments();
  publish();
  thread_ = std::thread([this] { run(); });
}

SimulationLoop::~SimulationLoop() {
  stops_ = true;
  thread_.join();
}

void SimulationLoop::exchange(std::size_t instrument, const InstrumentModel& model) {
  const std::lock_guard lock(request_mutex_);
  request_ = Request{instrument, model};
  is_asked_ = true;
}

/// Returns whether there was a request.
bool SimulationLoop::exchange_if_asked() {
  if (!is_asked_) return false;
  std::optional<Request> request;
  {
    const std::lock_guard lock(request_mutex_);
    request = std::exchange(request_, std::nullopt);
    is_asked_ = false;
  }
  if (!request) return false;
  const auto& [instrument, model] = *request;
  ++next_.exchanges;
  try {
    instruments_->exchange(instrument, model);
    next_.refusal.reset();
    list_instruments();
    if (exchanged_) exchanged_(instrument, model);
    watch(instrument);
  } catch (const InputError& error) {
    next_.refusal = std::make_shared<const ExchangeRefusal>(ExchangeRefusal{instrument, error.what()});
  }
  return true;
}

void SimulationLoop::list_instruments() {
  std::vector<InstrumentModel> instruments;
  for (std::size_t d = 0; d < instruments_->count(); ++d)
    instruments.push_back(instruments_->rod(d).instrument());
  next_.instruments = std::make_shared<const std::vector<InstrumentModel>>(std::move(instruments));
}

void SimulationLoop::publish() {
  next_.time_s = instruments_->time_s();
  next_.agent_outlet = agent_outlet(*instruments_);
  next_.agent_lumen_mm = agent_lumen_mm(*instruments_);
  next_.phases.assign(instruments_->phases().begin(), instruments_->phases().end());
  if (instruments_->vessel_changes() != vessel_changes_) {
    vessel_changes_ = instruments_->vessel_changes();
    next_.treated = std::make_shared<const TreatedVessels>(
        TreatedVessels{instruments_->treatments().walls(), instruments_->treatments().stents()});
  }
  if (instruments_->coil_changes() != coil_changes_) {
    coil_changes_ = instruments_->coil_changes();
    std::vector<CoiledSac> coiled;
    for (const CoilPack& pack : instruments_->coil_packs())
      coiled.push_back({pack.packing(), pack.sum().wire_mm(), pack.coils()});
    next_.coiled = std::make_shared<const std::vector<CoiledSac>>(std::move(coiled));
  }
  publish(0, next_);
  for (std::size_t d = 1; d < instruments_->count(); ++d) publish(d, next_.inner[d - 1]);
  snapshots_.write(next_);
}

void SimulationLoop::publish(std::size_t instrument, InstrumentSnapshot& snapshot) {
  hubs_[instrument] = snapshot.pose = instruments_->pose(instrument);
  loads_[instrument] = snapshot.load = instruments_->load(instrument);
  snapshot.tip = instruments_->tip(instrument);
  snapshot.balloon_bar = instruments_->balloon_bar(instrument);
  const auto lengths = instruments_->balloon_lengths(instrument);
  snapshot.balloon_lengths.assign(lengths.begin(), lengths.end());
  snapshot.carried_rings = instruments_->carried_rings(instrument);
  snapshot.coil = instruments_->pushed_coil(instrument);
  snapshot.nodes_mm.reserve(instruments_->rod(instrument).max_nodes());
  snapshot.contacts.reserve(instruments_->rod(instrument).max_nodes());
  instruments_->copy_nodes(instrument, snapshot.nodes_mm);
  instruments_->copy_contacts(instrument, snapshot.contacts);
}

void SimulationLoop::count(double step_ms, bool is_late) {
  LoopTiming& timing = next_.timing;
  ++timing.steps;
  timing.missed += is_late;
  sum_ms_ += step_ms;
  timing.mean_ms = sum_ms_ / static_cast<double>(timing.steps);
  timing.longest_ms = std::max(timing.longest_ms, step_ms);
  ++histogram_[std::min(kBins - 1, static_cast<std::size_t>(step_ms * kBins_per_ms))];
  if (timing.steps % kSummary_steps == 0) timing.p999_ms = percentile_ms(histogram_, timing.steps, 0.999);
}

void SimulationLoop::run() {
  try {
    step_until_stopped();
  } catch (...) {
    failure_ = std::current_exception();
    failed_ = true;
  }
}

void SimulationLoop::step_until_stopped() {
  raise_priority();
  watch();
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(instruments_->step_s()));
  auto begin = Clock::now();
  while (!stops_) {
    if (exchange_if_asked()) {
      publish();
      begin = Clock::now();
    }
    const Stopwatch stopwatch;
    const double step_s = instruments_->step_s();
    const std::span<const HubPose> targets = hand_(hubs_, loads_, step_s);
    if (body_)
      instruments_->step(targets, body_(step_s));
    else
      instruments_->step(targets);
    watch();
    publish();
    begin += period;
    const auto now = Clock::now();
    count(stopwatch.ms(), now > begin);
    if (now - begin > kMaxDelay) begin = now;
    std::this_thread::sleep_until(begin);
  }
}

}  // namespace xraycast
