# cmake -DOUTPUT=embedded.cpp -DFILES="a.json;b.json" -DKIND=instrument -DHEADER=xraycast/mechanics/embedded_instruments.hpp
#   [-DTYPE=EmbeddedFile] -P EmbedFiles.cmake
# Writes a C++ file with every file's text, `#include "header"` lines replaced by the header, so that a driver never
# needs to find a file. The text becomes a list of bytes: string literals have a size limit. HEADER declares
# TYPE {name, source} and embedded_<kind>s(). The name is the file's, without .cl or .json, which say no more
# than the kind; with the shaders' extensions, which name their stage.
if(NOT DEFINED TYPE)
  set(TYPE EmbeddedFile)
endif()
set(out "#include \"${HEADER}\"\n\nnamespace xraycast {\nnamespace {\n")
set(table "")
foreach(file IN LISTS FILES)
  get_filename_component(name "${file}" NAME)
  string(REGEX REPLACE "\\.(cl|json)$" "" name "${name}")
  string(MAKE_C_IDENTIFIER "kText_${name}" variable)
  get_filename_component(dir "${file}" DIRECTORY)
  file(READ "${file}" text)
  # Headers include headers; their guards make repeats harmless.
  while(text MATCHES "#include \"([a-z_/]+\\.(h|glsl))\"")
    set(line "${CMAKE_MATCH_0}")
    file(READ "${dir}/${CMAKE_MATCH_1}" header)
    string(REPLACE "${line}" "${header}" text "${text}")
  endwhile()
  string(HEX "${text}" hex)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(APPEND out "const unsigned char ${variable}[] = {${bytes}0x00};\n")
  string(APPEND table "    {\"${name}\", {reinterpret_cast<const char*>(${variable}), sizeof ${variable} - 1}},\n")
endforeach()
string(APPEND out "const ${TYPE} kFiles[] = {\n${table}};\n}  // namespace\n\n")
string(APPEND out "std::span<const ${TYPE}> embedded_${KIND}s() { return kFiles; }\n\n}  // namespace xraycast\n")
file(WRITE "${OUTPUT}" "${out}")
