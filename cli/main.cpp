#include <cstdio>

#include "xraycast/device.hpp"

int main() {
  for (const auto& info : xraycast::Device::list()) std::puts(info.name.c_str());
  xraycast::Device device;
  return device.self_test().images ? 0 : 4;
}
