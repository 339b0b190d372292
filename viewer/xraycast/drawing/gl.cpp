#include "xraycast/drawing/gl.hpp"

#include "xraycast/base/error.hpp"
#include "xraycast/drawing/embedded_shaders.hpp"

#include <glm/gtc/type_ptr.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>

#include <algorithm>
#include <array>
#include <sstream>
#include <vector>

namespace xraycast::gl {
namespace detail {

std::atomic<int> alive{0};

}  // namespace detail

namespace {

GLuint compiled(GLenum stage, const std::string& name, const std::string& defines) {
  const auto shaders = embedded_shaders();
  const auto shader = std::ranges::find(shaders, name, &EmbeddedFile::name);
  if (shader == shaders.end()) throw Error("there is no shader {}", name);
  const GLuint id = glCreateShader(stage);
  std::string text = "#version 330 core\n";
  std::istringstream names(defines);
  for (std::string word; names >> word;) text += "#define " + word + "\n";
  text += shader->source;
  const char* start = text.data();
  const auto length = static_cast<GLint>(text.size());
  glShaderSource(id, 1, &start, &length);
  glCompileShader(id);
  GLint done = 0;
  glGetShaderiv(id, GL_COMPILE_STATUS, &done);
  if (!done) {
    std::vector<char> log(4096);
    glGetShaderInfoLog(id, static_cast<GLsizei>(log.size()), nullptr, log.data());
    glDeleteShader(id);
    throw Error("shader {} does not compile with this OpenGL driver: {}", name, log.data());
  }
  return id;
}

/// Whether the last allocation failed.
bool is_out_of_memory() { return glGetError() == GL_OUT_OF_MEMORY; }

[[noreturn]] void throw_no_memory(const std::string& what, std::size_t size_B) {
  throw InputError("{}: the OpenGL driver has no {} MB of memory left; cast fewer layers or angles", what,
                   size_B >> 20);
}

std::size_t texel_B(GLenum format) {
  switch (format) {
    case GL_R32F:
    case GL_RGBA8:
      return 4;
    case GL_RG32F:
    case GL_RGBA16F:
      return 8;
    default:
      return 16;
  }
}

}  // namespace

int objects_alive() { return detail::alive; }

Program::Program(const std::string& vertex, const std::string& fragment, const std::string& defines) {
  const GLuint v = compiled(GL_VERTEX_SHADER, vertex, defines),
               f = compiled(GL_FRAGMENT_SHADER, fragment, defines);
  id_ = glCreateProgram();
  ++detail::alive;
  glAttachShader(id_, v);
  glAttachShader(id_, f);
  glLinkProgram(id_);
  glDeleteShader(v);
  glDeleteShader(f);
  GLint done = 0;
  glGetProgramiv(id_, GL_LINK_STATUS, &done);
  if (done) return;
  std::vector<char> log(4096);
  glGetProgramInfoLog(id_, static_cast<GLsizei>(log.size()), nullptr, log.data());
  glDeleteProgram(id_);
  --detail::alive;
  throw Error("shaders {} and {} do not link with this OpenGL driver: {}", vertex, fragment, log.data());
}

Program::~Program() {
  if (id_ == 0) return;
  glDeleteProgram(id_);
  --detail::alive;
}

void Program::set(const char* name, const glm::dvec2& value) const {
  glUniform2f(at(name), static_cast<float>(value.x), static_cast<float>(value.y));
}

void Program::set(const char* name, const glm::dvec3& value) const {
  glUniform3f(at(name), static_cast<float>(value.x), static_cast<float>(value.y),
              static_cast<float>(value.z));
}

void Program::set(const char* name, const glm::dmat3& value) const {
  const glm::mat3 rounded(value);
  glUniformMatrix3fv(at(name), 1, GL_FALSE, glm::value_ptr(rounded));
}

void Program::set(const char* name, const glm::dmat4& value) const {
  const glm::mat4 rounded(value);
  glUniformMatrix4fv(at(name), 1, GL_FALSE, glm::value_ptr(rounded));
}

void Table::allocate(std::size_t size_B, const void* texels, const std::string& what) {
  const std::size_t count = size_B / texel_B(format_);
  GLint limit = 0;
  glGetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &limit);
  if (count > static_cast<std::size_t>(limit))
    throw InputError(
        "{}: {} texels, but the OpenGL driver allows {} in one texture; cast fewer layers or angles", what,
        count, limit);
  size_B_ = size_B;
  glBindBuffer(GL_TEXTURE_BUFFER, buffer_.id());
  glBufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(size_B_), texels, GL_DYNAMIC_DRAW);
  if (is_out_of_memory()) throw_no_memory(what, size_B_);
  glBindTexture(GL_TEXTURE_BUFFER, texture_.id());
  glTexBuffer(GL_TEXTURE_BUFFER, format_, buffer_.id());
}

void Table::fill(std::span<const float> values, const std::string& what) {
  static constexpr std::array<float, 4> kNothing{};
  if (values.empty()) values = kNothing;
  allocate(values.size_bytes(), values.data(), what);
}

void Table::fill_bytes(std::span<const std::byte> texels, const std::string& what) {
  allocate(texels.size(), texels.data(), what);
}

void Table::fill(std::size_t count, const std::function<void(std::span<float>)>& write,
                 const std::string& what) {
  allocate(count * sizeof(float), nullptr, what);
  map([&](void* mapped) { write({static_cast<float*>(mapped), count}); }, what);
}

void Table::fill_bytes(std::size_t count, const std::function<void(std::span<std::byte>)>& write,
                       const std::string& what) {
  if (count == size_B_)
    glBindBuffer(GL_TEXTURE_BUFFER, buffer_.id());
  else
    allocate(count, nullptr, what);
  map([&](void* mapped) { write({static_cast<std::byte*>(mapped), count}); }, what);
}

void Table::map(const std::function<void(void*)>& write, const std::string& what) {
  void* mapped = glMapBufferRange(GL_TEXTURE_BUFFER, 0, static_cast<GLsizeiptr>(size_B_),
                                  GL_MAP_WRITE_BIT | GL_MAP_INVALIDATE_BUFFER_BIT);
  if (is_out_of_memory() || !mapped) throw_no_memory(what, size_B_);
  try {
    write(mapped);
  } catch (...) {
    glUnmapBuffer(GL_TEXTURE_BUFFER);
    throw;
  }
  if (!glUnmapBuffer(GL_TEXTURE_BUFFER))
    throw Error("{}: the OpenGL driver lost its data; draw it again", what);
}

void Table::bind(const Program& program, const char* name, int unit) const {
  glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  glBindTexture(GL_TEXTURE_BUFFER, texture_.id());
  program.set(name, unit);
}

void Target::resize(int width, int height) {
  width = std::max(1, width);
  height = std::max(1, height);
  if (width == width_ && height == height_) return;
  GLint limit = 0;
  glGetIntegerv(GL_MAX_TEXTURE_SIZE, &limit);
  if (width > limit || height > limit)
    throw InputError(
        "a picture of {} x {} texels exceeds the OpenGL driver's limit of {} per side; make it smaller",
        width, height, limit);
  width_ = width;
  height_ = height;
  glBindTexture(GL_TEXTURE_2D, texture_.id());
  const bool is_depth = format_ == GL_DEPTH_COMPONENT32F;
  glTexImage2D(GL_TEXTURE_2D, 0, static_cast<GLint>(format_), width, height, 0,
               is_depth ? GL_DEPTH_COMPONENT : GL_RGBA, GL_FLOAT, nullptr);
  if (is_out_of_memory()) {
    width_ = height_ = 0;
    throw InputError(
        "a picture of {} x {} texels: the OpenGL driver has no memory left for it; make it smaller", width,
        height);
  }
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
}

void Target::fill(std::span<const float> values, int x, int y, int width, int height) {
  glBindTexture(GL_TEXTURE_2D, texture_.id());
  glTexSubImage2D(GL_TEXTURE_2D, 0, x, y, width, height, format_ == GL_R32F ? GL_RED : GL_RGBA, GL_FLOAT,
                  values.data());
}

void Target::bind(const Program& program, const char* name, int unit) const {
  glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
  glBindTexture(GL_TEXTURE_2D, texture_.id());
  program.set(name, unit);
}

Scissor::Scissor(int x, int y, int width, int height) {
  glEnable(GL_SCISSOR_TEST);
  glScissor(x, y, width, height);
}

DepthTest::DepthTest(GLenum comparison) {
  glEnable(GL_DEPTH_TEST);
  glDepthMask(GL_FALSE);
  glDepthFunc(comparison);
}

DepthTest::~DepthTest() {
  glDepthMask(GL_TRUE);
  glDisable(GL_DEPTH_TEST);
}

}  // namespace xraycast::gl
