#pragma once

/// Before a function: compile it for AVX2 too, and take that one where the processor has it. Not under
/// AddressSanitizer, which is not yet there when the choice is made.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define XRAYCAST_WIDE_VECTORS __attribute__((target_clones("arch=haswell", "default")))
#else
#define XRAYCAST_WIDE_VECTORS
#endif
