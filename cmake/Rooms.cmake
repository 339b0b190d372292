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
endfunction()

# Installs the public headers of a library's rooms: those that rooms.txt does not name private.
function(xraycast_install_headers library)
  file(STRINGS "${PROJECT_SOURCE_DIR}/rooms.txt" rooms REGEX "^${library}/xraycast/")
  foreach(line IN LISTS rooms)
    string(REGEX MATCH "^([^:]+):? *(.*)$" _ "${line}")
    set(folder "${CMAKE_MATCH_1}")
    separate_arguments(private UNIX_COMMAND "${CMAKE_MATCH_2}")
    set(excluded)
    foreach(name IN LISTS private)
      list(APPEND excluded PATTERN "${name}.hpp" EXCLUDE)
    endforeach()
    cmake_path(GET folder FILENAME room)
    install(DIRECTORY "${PROJECT_SOURCE_DIR}/${folder}/" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/xraycast/${room}"
      COMPONENT dev FILES_MATCHING PATTERN "*.h" PATTERN "*.hpp" ${excluded})
  endforeach()
endfunction()
