// "Object Files (.obj)", Wavefront's Advanced Visualizer, appendix B1.
#include "xraycast/geometry/obj.hpp"

#include "xraycast/base/plain_text.hpp"
#include "xraycast/base/whole_file.hpp"
#include "xraycast/geometry/mesh_builder.hpp"
#include "xraycast/geometry/text_lines.hpp"

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace xraycast {
namespace {

class ObjReader {
 public:
  ObjReader(std::string_view text, const std::string& name) : lines_(text, name), mesh_(name) {}

  Mesh read() {
    while (const auto line = lines_.next()) {
      std::string_view words = *line;
      if (words.starts_with('#')) mesh_.read_space(words);
      const std::string_view keyword = take_word(words);
      if (keyword == "v") read_vertex(words);
      if (keyword == "f") read_face(words);
    }
    if (faces_ == 0) lines_.fail("the file ends without a face, so it is no surface");
    return mesh_.take();
  }

 private:
  /// Weights and colours may follow.
  void read_vertex(std::string_view words) {
    glm::dvec3 point_mm;
    for (int axis = 0; axis < 3; ++axis) {
      const auto number = real_number(take_word(words));
      if (!number) lines_.fail("a vertex needs three numbers");
      point_mm[axis] = *number;
    }
    if (mesh_.points() == std::numeric_limits<std::uint32_t>::max()) lines_.fail("too many vertices");
    mesh_.add_point(point_mm, "vertex");
  }

  void read_face(std::string_view words) {
    corners_.clear();
    for (std::string_view word = take_word(words);; word = take_word(words)) {
      if (word == "\\") {  // the face goes on in the next line
        words = lines_.next().value_or("");
        continue;
      }
      if (word.empty()) break;
      corners_.push_back(corner(word.substr(0, word.find('/'))));
    }
    mesh_.add_polygon(corners_, "face", faces_++);
  }

  /// Counted from 1 on, or backwards from the last vertex.
  std::uint32_t corner(std::string_view word) const {
    std::int64_t number = 0;
    if (!parse_whole(word, number)) lines_.fail("\"{}\" is not the number of a vertex", excerpt(word));
    const std::int64_t index = number > 0 ? number - 1 : static_cast<std::int64_t>(mesh_.points()) + number;
    if (number == 0 || index < 0 || index > std::numeric_limits<std::uint32_t>::max())
      lines_.fail("there is no vertex {}", number);
    return static_cast<std::uint32_t>(index);
  }

  TextLines lines_;
  MeshBuilder mesh_;
  std::vector<std::uint32_t> corners_;
  std::size_t faces_ = 0;
};

}  // namespace

Mesh read_obj(const std::filesystem::path& path) {
  const std::string text = read_whole_file(path);
  return ObjReader(text, path.string()).read();
}

}  // namespace xraycast
