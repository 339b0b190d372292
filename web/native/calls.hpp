#pragma once

#include <exception>
#include <string>
#include <vector>

/// What the functions that a page's worker calls share.
namespace xraycast::page {

/// What a call takes or gives.
inline std::vector<double> numbers;

/// What a call says; it stays until the next one.
inline std::string text;

/// What went wrong in the action; null where it did not fail.
template <typename Action>
const char* failure_of(const Action& action) {
  try {
    action();
    return nullptr;
  } catch (const std::exception& error) {
    text = error.what();
    return text.c_str();
  }
}

}  // namespace xraycast::page
