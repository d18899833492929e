// RAII owners of OpenGL objects. An object is created in the current context and must be destroyed while that
// context is current. Internal to smartsurf/view.
#pragma once

#include <epoxy/gl.h>

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "common/image/Image.h"

namespace smartsurf::view {

template <void (*kFree)(GLuint)>
class GlHandle {
 public:
  GlHandle() = default;
  explicit GlHandle(GLuint id) : id_(id) {}
  GlHandle(GlHandle&& other) noexcept : id_(std::exchange(other.id_, 0)) {}
  GlHandle& operator=(GlHandle&& other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~GlHandle() {
    if (id_ != 0) kFree(id_);
  }
  GLuint id() const { return id_; }

 private:
  GLuint id_ = 0;
};

inline void free_buffer(GLuint id) { glDeleteBuffers(1, &id); }
inline void free_vertex_array(GLuint id) { glDeleteVertexArrays(1, &id); }
inline void free_texture(GLuint id) { glDeleteTextures(1, &id); }
inline void free_framebuffer(GLuint id) { glDeleteFramebuffers(1, &id); }
inline void free_sampler(GLuint id) { glDeleteSamplers(1, &id); }
inline void free_program(GLuint id) { glDeleteProgram(id); }

using Buffer = GlHandle<free_buffer>;
using VertexArray = GlHandle<free_vertex_array>;
using Texture = GlHandle<free_texture>;
using Framebuffer = GlHandle<free_framebuffer>;
using Sampler = GlHandle<free_sampler>;
using ShaderProgram = GlHandle<free_program>;

template <class Handle, class Make>
Handle make(Make generate) {
  GLuint id = 0;
  generate(1, &id);
  return Handle(id);
}
inline Buffer make_buffer() { return make<Buffer>(glGenBuffers); }
inline VertexArray make_vertex_array() { return make<VertexArray>(glGenVertexArrays); }
inline Texture make_texture() { return make<Texture>(glGenTextures); }
inline Framebuffer make_framebuffer() { return make<Framebuffer>(glGenFramebuffers); }
inline Sampler make_sampler() { return make<Sampler>(glGenSamplers); }

// Blending by the source's alpha. The target's alpha keeps the share of its colour that is subject to ambient
// occlusion.
inline void blend_over() {
  glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ZERO, GL_ONE_MINUS_SRC_ALPHA);
}

// Binds the buffer and fills it.
template <class Values>
void upload_buffer(GLenum target, const Buffer& buffer, const Values& values, GLenum usage) {
  const std::span all(values);
  glBindBuffer(target, buffer.id());
  glBufferData(target, all.size_bytes(), all.data(), usage);
}

// Declares an attribute of `size` floats of the bound buffer, from the number `first` of each vertex.
inline void set_vertex_attribute(GLuint location, GLint size, int floats_per_vertex, std::size_t first) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, floats_per_vertex * sizeof(float),
                        reinterpret_cast<const void*>(first * sizeof(float)));
}

// Declares an attribute of `size` components of the bound buffer, which holds one Instance for each instance
// drawn. Bytes are scaled to [0, 1].
template <class Instance>
void set_instance_attribute(GLuint location, GLint size, GLenum type, std::size_t offset) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, type, type == GL_UNSIGNED_BYTE ? GL_TRUE : GL_FALSE, sizeof(Instance),
                        reinterpret_cast<const void*>(offset));
  glVertexAttribDivisor(location, 1);
}

// Compiles and links a program. The uniform block `Frame` is bound to binding point 0 and the sampler
// `shadow_map` to texture unit 0, `shadow_depth` to unit 3, if the program uses them. A failure is a bug here
// or in the driver: throws std::runtime_error with `name` and the driver's log.
ShaderProgram link_program(std::string_view name, const std::string& vertex, const std::string& fragment);

// An off-screen framebuffer: single-sampled, RGBA8 colour and 24-bit depth.
struct RenderTarget {
  Framebuffer framebuffer;
  Texture colour, depth;
  int width = 0, height = 0;

  // Copies a picture of the target's size.
  void set_picture(const common::Image& image);
  // Reallocates the buffers if the size changes. Throws std::runtime_error if the driver refuses the size.
  void resize(int new_width, int new_height);
};

// An off-screen framebuffer of two 16-bit floats per pixel.
struct ColourTarget {
  Framebuffer framebuffer;
  Texture colour;
  int width = 0, height = 0;

  void resize(int new_width, int new_height);  // as RenderTarget
};

// Reads the framebuffer's colours, row 0 at the top. Its context must be current.
common::Image read_framebuffer(unsigned framebuffer, int width, int height);

}  // namespace smartsurf::view
