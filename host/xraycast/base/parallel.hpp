#pragma once

#include <cstdint>
#include <functional>

namespace xraycast {

class Progress;

/// While it lives, loops on this thread and on those that parallel_for starts end by Cancelled once
/// `progress` is cancelled: for long work whose inner functions take no Progress. Scopes may be nested.
class CancelScope {
 public:
  explicit CancelScope(const Progress* progress);
  explicit CancelScope(const Progress& progress) : CancelScope(&progress) {}
  ~CancelScope();
  CancelScope(const CancelScope&) = delete;
  CancelScope& operator=(const CancelScope&) = delete;

  /// That of the innermost scope of this thread; null outside of any.
  static const Progress* current();

 private:
  const Progress* outer_;
};

/// Throws Cancelled where the current scope's Progress is cancelled. For long loops that are not
/// parallel_for.
void check_cancelled();

/// Calls `work(i)` once for every i in [0, count), on all cores, or at most as many as XRAYCAST_THREADS says
/// at the first call, in no particular order, and returns when all calls have. The first exception, or the
/// end of the current CancelScope's work, ends the loop early and is thrown here.
void parallel_for(std::int64_t count, const std::function<void(std::int64_t)>& work);

}  // namespace xraycast
