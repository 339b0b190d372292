#include "calls.hpp"

#include <cstddef>
#include <emscripten/emscripten.h>

extern "C" {

/// Room for so many numbers, which the next call takes.
EMSCRIPTEN_KEEPALIVE double* room_for(std::size_t count) {
  xraycast::page::numbers.resize(count);
  return xraycast::page::numbers.data();
}

}  // extern "C"
