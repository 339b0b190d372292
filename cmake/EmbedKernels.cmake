# cmake -DOUTPUT=embedded.cpp -DFILES="a.cl;b.cl" -P EmbedKernels.cmake
# Writes a C++ file with every kernel's text, `#include "header"` lines replaced by the header, so that a
# driver never needs to find a file. The text becomes a list of bytes: string literals have a size limit.
set(out "#include \"embedded_kernels.h\"\n\nnamespace xraycast {\nnamespace {\n")
set(table "")
foreach(file IN LISTS FILES)
  get_filename_component(name "${file}" NAME_WE)
  get_filename_component(dir "${file}" DIRECTORY)
  file(READ "${file}" text)
  # Headers include headers; their guards make repeats harmless.
  while(text MATCHES "#include \"([a-z_]+\\.h)\"")
    set(line "${CMAKE_MATCH_0}")
    file(READ "${dir}/${CMAKE_MATCH_1}" header)
    string(REPLACE "${line}" "${header}" text "${text}")
  endwhile()
  string(HEX "${text}" hex)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(APPEND out "const unsigned char ${name}_text[] = {${bytes}0x00};\n")
  string(APPEND table "    {\"${name}\", {reinterpret_cast<const char*>(${name}_text), sizeof ${name}_text - 1}},\n")
endforeach()
string(APPEND out "const EmbeddedKernel kKernels[] = {\n${table}};\n}  // namespace\n\n")
string(APPEND out "std::span<const EmbeddedKernel> embedded_kernels() { return kKernels; }\n\n}  // namespace xraycast\n")
file(WRITE "${OUTPUT}" "${out}")
