# What rooms.txt says, for the build and for the installation.

# A unity build compiles a room as one unit: two to three times faster from scratch. Names in anonymous namespaces are
# therefore unique within a room. What stands behind APART is compiled alone: its libraries' headers or its own constants
# mix with no others.
function(xraycast_compile_by_room target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "APART")
  set_target_properties(${target} PROPERTIES UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    cmake_path(GET source STEM name)
    cmake_path(GET source PARENT_PATH folder)
    if(NOT name IN_LIST arg_APART AND NOT IS_ABSOLUTE "${source}")
      cmake_path(GET folder FILENAME room)
      set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "${room}")
    endif()
  endforeach()
  # What most rooms include is compiled ahead, once a library.
  target_precompile_headers(${target} PRIVATE
    <algorithm> <array> <cmath> <filesystem> <functional> <memory> <numeric> <optional> <random> <span> <string> <vector>
    <fmt/format.h> <glm/common.hpp> <glm/geometric.hpp> <glm/vec2.hpp> <glm/vec3.hpp>)
endfunction()

# Installs the public headers of a library's rooms, those that rooms.txt does not name private: in include/ those of
# stable.txt, and the others apart.
function(xraycast_install_headers library)
  file(STRINGS "${PROJECT_SOURCE_DIR}/stable.txt" stable REGEX "^${library}:")
  string(REGEX REPLACE "^[^:]+: *" "" stable "${stable}")
  separate_arguments(stable UNIX_COMMAND "${stable}")
  file(STRINGS "${PROJECT_SOURCE_DIR}/rooms.txt" rooms REGEX "^${library}/xraycast/")
  foreach(line IN LISTS rooms)
    string(REGEX MATCH "^([^:]+):? *(.*)$" _ "${line}")
    set(folder "${CMAKE_MATCH_1}")
    separate_arguments(private UNIX_COMMAND "${CMAKE_MATCH_2}")
    cmake_path(GET folder FILENAME room)
    file(GLOB headers CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/${folder}/*.h" "${PROJECT_SOURCE_DIR}/${folder}/*.hpp")
    foreach(header IN LISTS headers)
      cmake_path(GET header STEM name)
      if("${room}/${name}" IN_LIST stable)
        install(FILES "${header}" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/xraycast/${room}" COMPONENT dev)
      elseif(NOT name IN_LIST private)
        install(FILES "${header}" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/xraycast-detail/xraycast/${room}" COMPONENT dev)
      endif()
    endforeach()
  endforeach()
endfunction()
