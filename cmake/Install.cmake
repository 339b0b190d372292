# `cmake --install build/release --prefix P` puts the program under P, and the library as a package that
# find_package(xraycast) finds; tests/consumer uses it.
include(CMakePackageConfigHelpers)

set(package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/xraycast")
install(TARGETS xraycast)
install(TARGETS xraycast_level_set LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}/xraycast")
install(TARGETS xraycast_host xraycast_kernels EXPORT xraycastTargets)
install(DIRECTORY host/xraycast TYPE INCLUDE FILES_MATCHING PATTERN "*.hpp")
install(FILES kernels/embedded_kernels.h kernels/params.h DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/xraycast/kernels")
install(EXPORT xraycastTargets NAMESPACE xraycast:: DESTINATION "${package_dir}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/xraycastConfigVersion.cmake" COMPATIBILITY SameMinorVersion)
install(FILES cmake/xraycastConfig.cmake "${PROJECT_BINARY_DIR}/xraycastConfigVersion.cmake"
  DESTINATION "${package_dir}")
