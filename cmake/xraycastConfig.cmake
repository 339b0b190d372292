# find_package(xraycast COMPONENTS host segmentation simulation viewer): those asked for, and what they stand on; host
# where none is named. The libraries are static: whoever links one needs what it links. `project` must enable C beside
# C++, for ITK.
set(xraycast_components ${xraycast_FIND_COMPONENTS} host)
if("viewer" IN_LIST xraycast_components)
  list(APPEND xraycast_components simulation)
endif()
foreach(component IN LISTS xraycast_FIND_COMPONENTS)
  if(NOT EXISTS "${CMAKE_CURRENT_LIST_DIR}/xraycast-${component}.cmake")
    set(xraycast_FOUND FALSE)
    set(xraycast_NOT_FOUND_MESSAGE "xraycast has no component ${component}: host, segmentation, simulation or viewer")
    return()
  endif()
endforeach()

include(CMakeFindDependencyMacro)
find_dependency(PkgConfig)

# host
find_dependency(Threads)
find_dependency(OpenCL)
find_dependency(ITK 5.2 COMPONENTS ITKCommon ITKIOImageBase ITKIONIFTI ITKIONRRD)
find_dependency(GDCM)
find_dependency(ZLIB)
find_dependency(OpenEXR)
find_dependency(PNG)
find_dependency(glm)
find_dependency(fmt)
find_dependency(nlohmann_json)
find_dependency(pugixml)
pkg_check_modules(xraylib REQUIRED QUIET IMPORTED_TARGET libxrl)

if("segmentation" IN_LIST xraycast_components)
  # OpenVDB's find module lies beside it and names Boost's and TBB's parts.
  list(APPEND CMAKE_MODULE_PATH "/usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB")
  find_dependency(OpenVDB COMPONENTS openvdb)
  find_dependency(meshoptimizer)
endif()

if("simulation" IN_LIST xraycast_components)
  find_dependency(Eigen3 3.4)
endif()

if("viewer" IN_LIST xraycast_components)
  find_dependency(GIF)
  pkg_check_modules(cairo REQUIRED QUIET IMPORTED_TARGET cairo)
  pkg_check_modules(epoxy REQUIRED QUIET IMPORTED_TARGET epoxy)
  pkg_check_modules(glfw REQUIRED QUIET IMPORTED_TARGET glfw3)
  pkg_check_modules(imgui REQUIRED QUIET IMPORTED_TARGET imgui)
endif()

foreach(component IN ITEMS host segmentation simulation viewer)
  if(component IN_LIST xraycast_components)
    include("${CMAKE_CURRENT_LIST_DIR}/xraycast-${component}.cmake")
    set(xraycast_${component}_FOUND TRUE)
  endif()
endforeach()
