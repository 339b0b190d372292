# Linked privately by every target of ours, so that the warnings never reach a consumer.
add_library(xraycast_warnings INTERFACE)
target_compile_options(xraycast_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Wnon-virtual-dtor -Wold-style-cast
  # A unit of a unity build includes its sources, which have members of their own types.
  $<$<AND:$<CXX_COMPILER_ID:GNU>,$<BOOL:${CMAKE_UNITY_BUILD}>>:-Wno-subobject-linkage>
  $<$<BOOL:${XRAYCAST_WERROR}>:-Werror>)
