# `cmake --install build/release --prefix P` puts the program under P, and beside it the libraries, static and shared, as a
# package that find_package(xraycast COMPONENTS ...) finds; examples/ use it. The installation's components are Debian's packages.
include(CMakePackageConfigHelpers)

install(TARGETS xraycast COMPONENT program)

set(package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/xraycast")
install(TARGETS xraycast_kernels EXPORT xraycast-host ARCHIVE COMPONENT dev)
install(TARGETS xraycast_kernels_shared EXPORT xraycast-host LIBRARY COMPONENT libraries NAMELINK_COMPONENT dev)
foreach(library IN ITEMS host segmentation simulation viewer)
  install(TARGETS xraycast_${library} xraycast_${library}_shared EXPORT xraycast-${library}
    ARCHIVE COMPONENT dev LIBRARY COMPONENT libraries NAMELINK_COMPONENT dev)
endforeach()
install(TARGETS xraycast_c EXPORT xraycast-c LIBRARY COMPONENT c NAMELINK_COMPONENT dev)
foreach(library IN ITEMS kernels host segmentation simulation viewer)
  xraycast_install_headers(${library})
endforeach()
foreach(component IN ITEMS c host segmentation simulation viewer)
  install(EXPORT xraycast-${component} NAMESPACE xraycast:: DESTINATION "${package_dir}" COMPONENT dev)
endforeach()
install(TARGETS xraycast_smoothed_mask xraycast_surface_distance xraycast_morphology xraycast_matrices xraycast_pictures xraycast_transforms LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}/xraycast"
  COMPONENT libraries)
write_basic_package_version_file("${PROJECT_BINARY_DIR}/xraycastConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES cmake/xraycastConfig.cmake "${PROJECT_BINARY_DIR}/xraycastConfigVersion.cmake"
  DESTINATION "${package_dir}" COMPONENT dev)
