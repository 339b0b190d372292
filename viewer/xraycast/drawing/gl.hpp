#pragma once

#include <glm/fwd.hpp>

#include <atomic>
#include <cstddef>
#include <epoxy/gl.h>
#include <functional>
#include <span>
#include <string>
#include <utility>

/// The few OpenGL objects that the viewer needs, as move-only handles. A context must be current wherever
/// they are made, used and destroyed.
namespace xraycast::gl {

/// The number of existing OpenGL objects of all kinds; for leak tests.
int objects_alive();

namespace detail {

extern std::atomic<int> alive;

struct TextureKind {
  static void make(GLuint* id) { glGenTextures(1, id); }
  static void destroy(const GLuint* id) { glDeleteTextures(1, id); }
};
struct BufferKind {
  static void make(GLuint* id) { glGenBuffers(1, id); }
  static void destroy(const GLuint* id) { glDeleteBuffers(1, id); }
};
struct VertexArrayKind {
  static void make(GLuint* id) { glGenVertexArrays(1, id); }
  static void destroy(const GLuint* id) { glDeleteVertexArrays(1, id); }
};
struct FramebufferKind {
  static void make(GLuint* id) { glGenFramebuffers(1, id); }
  static void destroy(const GLuint* id) { glDeleteFramebuffers(1, id); }
};

template <typename Kind>
class Object {
 public:
  Object() {
    Kind::make(&id_);
    ++alive;
  }
  ~Object() {
    if (id_ == 0) return;
    Kind::destroy(&id_);
    --alive;
  }
  Object(Object&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  Object& operator=(Object&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }

  GLuint id() const { return id_; }

 private:
  GLuint id_ = 0;
};

}  // namespace detail

using Texture = detail::Object<detail::TextureKind>;
using Buffer = detail::Object<detail::BufferKind>;
using VertexArray = detail::Object<detail::VertexArrayKind>;
using Framebuffer = detail::Object<detail::FramebufferKind>;

/// A linked pair of embedded shaders.
class Program {
 public:
  /// Files of viewer/shaders, compiled with `defines` (names separated by spaces): variants instead of
  /// branches, because software drivers execute both sides of a branch. Throws Error with the driver's log.
  Program(const std::string& vertex, const std::string& fragment, const std::string& defines = "");
  ~Program();
  Program(Program&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  Program& operator=(Program&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }

  /// Makes it the current program, whose uniforms the following calls set.
  void use() const { glUseProgram(id_); }
  void set(const char* name, int value) const { glUniform1i(at(name), value); }
  void set(const char* name, bool value) const { glUniform1i(at(name), value ? 1 : 0); }
  void set(const char* name, double value) const { glUniform1f(at(name), static_cast<float>(value)); }
  void set(const char* name, const glm::dvec2& value) const;
  void set(const char* name, const glm::dvec3& value) const;
  void set(const char* name, const glm::dmat3& value) const;
  void set(const char* name, const glm::dmat4& value) const;

 private:
  GLint at(const char* name) const { return glGetUniformLocation(id_, name); }

  GLuint id_ = 0;
};

/// A table that shaders read by texelFetch from a samplerBuffer.
class Table {
 public:
  /// GL_R32F, GL_RG32F, GL_RGBA32F, GL_RGBA16F or GL_RGBA8.
  explicit Table(GLenum format) : format_(format) {}

  /// Throws InputError, naming `what`, when it has more texels than the driver supports or has memory for.
  /// Of 32-bit floats, as the next.
  void fill(std::span<const float> values, const std::string& what);

  /// The same with `count` values, at least one, that `write` puts into the mapped buffer, in any order and
  /// from any thread; its former contents are undefined.
  void fill(std::size_t count, const std::function<void(std::span<float>)>& write, const std::string& what);

  /// The same with the bytes of whole texels of any format.
  void fill_bytes(std::span<const std::byte> texels, const std::string& what);

  /// The same that `write` puts into the mapped buffer, as fill() does. A buffer of that size is kept.
  void fill_bytes(std::size_t count, const std::function<void(std::span<std::byte>)>& write,
                  const std::string& what);

  /// Binds it to texture unit `unit` and sampler `name` of the current program.
  void bind(const Program& program, const char* name, int unit) const;

  std::size_t size_B() const { return size_B_; }

 private:
  /// Reallocates the buffer and leaves it bound.
  void allocate(std::size_t size_B, const void* texels, const std::string& what);

  /// Lets `write` fill the bound buffer.
  void map(const std::function<void(void*)>& write, const std::string& what);

  GLenum format_;
  std::size_t size_B_ = 0;
  Buffer buffer_;
  Texture texture_;
};

/// A texture that is attached to a framebuffer, drawn into, and read by texelFetch.
class Target {
 public:
  explicit Target(GLenum format) : format_(format) {}

  /// Reallocates it as `width` x `height`, at least 1 x 1; its contents are lost where the size changes.
  /// Throws InputError when it is larger than the driver supports or has memory for.
  void resize(int width, int height);

  /// Uploads a rectangle of pixels at (x, y), the bottom row first.
  void fill(std::span<const float> values, int x, int y, int width, int height);

  void bind(const Program& program, const char* name, int unit) const;
  GLuint texture() const { return texture_.id(); }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  GLenum format_;
  int width_ = 0, height_ = 0;
  Texture texture_;
};

/// Restricts drawing and clearing to a rectangle of the framebuffer during its lifetime.
class Scissor {
 public:
  Scissor(int x, int y, int width, int height);
  ~Scissor() { glDisable(GL_SCISSOR_TEST); }
  Scissor(const Scissor&) = delete;
  Scissor& operator=(const Scissor&) = delete;
};

/// Restricts drawing to pixels that pass this comparison with the depth buffer, which is not written, during
/// its lifetime.
class DepthTest {
 public:
  explicit DepthTest(GLenum comparison);
  ~DepthTest();
  DepthTest(const DepthTest&) = delete;
  DepthTest& operator=(const DepthTest&) = delete;
};

}  // namespace xraycast::gl
