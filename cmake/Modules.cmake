# Libraries that take longer to load than all others together, or that start threads, are modules of their own, which
# the program loads when it first needs them and finds by its RUNPATH. `library` is the one that loads it.
function(xraycast_module library name source)
  add_library(xraycast_${name} MODULE ${source})
  set_target_properties(xraycast_${name} PROPERTIES LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/lib/xraycast")
  target_include_directories(xraycast_${name} PRIVATE "${CMAKE_CURRENT_SOURCE_DIR}" "${PROJECT_SOURCE_DIR}/host")
  target_link_libraries(xraycast_${name} PRIVATE ${ARGN} xraycast_warnings)
  string(TOUPPER ${name} definition)
  target_compile_definitions(xraycast_${library} PRIVATE XRAYCAST_${definition}_MODULE="$<TARGET_FILE_NAME:xraycast_${name}>")
  add_dependencies(xraycast_${library} xraycast_${name})
endfunction()
