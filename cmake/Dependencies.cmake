# Everything comes from Debian 12; packages.txt names the packages.
find_package(Threads REQUIRED)
find_package(OpenCL REQUIRED)
find_package(OpenCLHeadersCpp QUIET)
find_package(ITK 5.2 REQUIRED COMPONENTS
  ITKCommon ITKIOImageBase ITKIONIFTI ITKIONRRD ITKIOMeta)
# GDCM's package complains of command line tools that Debian packs apart.
find_package(GDCM REQUIRED QUIET)
find_package(OpenImageIO 2.4 REQUIRED)
# Its target names OpenCV's headers, which Debian's package does not depend on and we do not use through it.
get_target_property(oiio_includes OpenImageIO::OpenImageIO INTERFACE_INCLUDE_DIRECTORIES)
list(FILTER oiio_includes EXCLUDE REGEX "opencv")
set_target_properties(OpenImageIO::OpenImageIO PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${oiio_includes}")
find_package(glm REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(pugixml REQUIRED)
find_package(ZLIB REQUIRED)
find_package(CLI11 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(xraylib REQUIRED IMPORTED_TARGET libxrl)
pkg_check_modules(epoxy REQUIRED IMPORTED_TARGET epoxy)
pkg_check_modules(glfw REQUIRED IMPORTED_TARGET glfw3)
pkg_check_modules(imgui REQUIRED IMPORTED_TARGET imgui)
