#include "smartsurf/view/gl/GlObjects.h"

#include <array>
#include <stdexcept>

#include "common/gl/Framebuffer.h"

namespace smartsurf::view {
namespace {

class Shader {
 public:
  Shader(GLenum kind, std::string_view name, const std::string& source) : id_(glCreateShader(kind)) {
    const char* text = source.c_str();
    glShaderSource(id_, 1, &text, nullptr);
    glCompileShader(id_);
    GLint ok = GL_FALSE;
    glGetShaderiv(id_, GL_COMPILE_STATUS, &ok);
    if (ok == GL_TRUE) return;
    std::array<char, 2048> log{};
    glGetShaderInfoLog(id_, static_cast<GLsizei>(log.size()), nullptr, log.data());
    glDeleteShader(id_);
    throw std::runtime_error("OpenGL: the shader '" + std::string(name) +
                             "' does not compile: " + log.data());
  }
  Shader(const Shader&) = delete;
  ~Shader() { glDeleteShader(id_); }
  GLuint id() const { return id_; }

 private:
  GLuint id_;
};

// Sets the filter of the bound texture.
void set_nearest_filter() {
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
}

// Throws if the bound framebuffer is not complete.
void require_complete(int width, int height) {
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
    throw std::runtime_error("OpenGL: the driver cannot render an image of " + std::to_string(width) + " × " +
                             std::to_string(height) + " pixels");
}

}  // namespace

ShaderProgram link_program(std::string_view name, const std::string& vertex, const std::string& fragment) {
  const Shader vertex_shader(GL_VERTEX_SHADER, name, vertex),
      fragment_shader(GL_FRAGMENT_SHADER, name, fragment);
  ShaderProgram program(glCreateProgram());
  glAttachShader(program.id(), vertex_shader.id());
  glAttachShader(program.id(), fragment_shader.id());
  glLinkProgram(program.id());
  GLint ok = GL_FALSE;
  glGetProgramiv(program.id(), GL_LINK_STATUS, &ok);
  if (ok != GL_TRUE) {
    std::array<char, 2048> log{};
    glGetProgramInfoLog(program.id(), static_cast<GLsizei>(log.size()), nullptr, log.data());
    throw std::runtime_error("OpenGL: the program '" + std::string(name) + "' does not link: " + log.data());
  }
  const GLuint block = glGetUniformBlockIndex(program.id(), "Frame");
  if (block != GL_INVALID_INDEX) glUniformBlockBinding(program.id(), block, 0);
  glUseProgram(program.id());
  for (const auto& [sampler, unit] : {std::pair{"shadow_map", 0}, std::pair{"shadow_depth", 3}})
    if (const GLint at = glGetUniformLocation(program.id(), sampler); at >= 0) glUniform1i(at, unit);
  return program;
}

void RenderTarget::resize(int new_width, int new_height) {
  if (new_width == width && new_height == height) return;
  framebuffer = make_framebuffer();
  colour = make_texture();
  depth = make_texture();
  glBindTexture(GL_TEXTURE_2D, colour.id());
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, new_width, new_height, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  set_nearest_filter();
  glBindTexture(GL_TEXTURE_2D, depth.id());
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, new_width, new_height, 0, GL_DEPTH_COMPONENT,
               GL_UNSIGNED_INT, nullptr);
  set_nearest_filter();
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, colour.id(), 0);
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, depth.id(), 0);
  require_complete(new_width, new_height);
  width = new_width;
  height = new_height;
}

void RenderTarget::set_picture(const common::Image& image) {
  glBindTexture(GL_TEXTURE_2D, colour.id());
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (int y = 0; y < image.height; ++y)
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, height - 1 - y, image.width, 1, GL_RGB, GL_UNSIGNED_BYTE,
                    image.pixel(0, y));
}

void ColourTarget::resize(int new_width, int new_height) {
  if (new_width == width && new_height == height) return;
  framebuffer = make_framebuffer();
  colour = make_texture();
  glBindTexture(GL_TEXTURE_2D, colour.id());
  glTexImage2D(GL_TEXTURE_2D, 0, GL_RG16F, new_width, new_height, 0, GL_RG, GL_FLOAT, nullptr);
  set_nearest_filter();
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, colour.id(), 0);
  require_complete(new_width, new_height);
  width = new_width;
  height = new_height;
}

common::Image read_framebuffer(unsigned framebuffer, int width, int height) {
  glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
  return common::read_framebuffer(width, height);
}

}  // namespace smartsurf::view
