// A worker of a page has one thread.
#include "xraycast/base/parallel.hpp"

namespace xraycast {

void parallel_for(std::int64_t count, const std::function<void(std::int64_t)>& work) {
  for (std::int64_t i = 0; i < count; ++i) work(i);
}

}  // namespace xraycast
