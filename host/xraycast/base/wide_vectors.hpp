#pragma once

/// Before a function: compiles it for AVX2 too and dispatches at load time. Not under AddressSanitizer and
/// ThreadSanitizer, which are not yet initialised when the dispatcher runs.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define XRAYCAST_WIDE_VECTORS __attribute__((target_clones("avx2", "default")))
#else
#define XRAYCAST_WIDE_VECTORS
#endif
