# cmake -DCLANG=clang-14 -DKERNELS="a.cl;b.cl" -P lint.cmake: clang reads every kernel as OpenCL C 1.2, with and without
# the options that they are built with, and warnings are errors.
set(lint "${CLANG}" -x cl -cl-std=CL1.2 -fsyntax-only -Wall -Wextra -Werror -Xclang -finclude-default-header
  -I "${CMAKE_CURRENT_LIST_DIR}")
foreach(kernel IN LISTS KERNELS)
  execute_process(COMMAND ${lint} -DRAMPS=0 "${kernel}" COMMAND_ERROR_IS_FATAL ANY)
  if(kernel MATCHES "joseph(_gradient)?.cl") # rays in any direction
    execute_process(COMMAND ${lint} -DRAMPS=2 -DSCAN_IMAGE "${kernel}" COMMAND_ERROR_IS_FATAL ANY)
  endif()
  execute_process(COMMAND ${lint} -DRAMPS=2 -DMOVED=4 "${kernel}" COMMAND_ERROR_IS_FATAL ANY)
  if(kernel MATCHES "(cylinder|basis).cl")
    execute_process(COMMAND ${lint} -DRAMPS=2 -DSLICES=1 "${kernel}" COMMAND_ERROR_IS_FATAL ANY)
    execute_process(COMMAND ${lint} -DRAMPS=2 -DMOVED=4 -DSLICES=2 "${kernel}" COMMAND_ERROR_IS_FATAL ANY)
  endif()
endforeach()
