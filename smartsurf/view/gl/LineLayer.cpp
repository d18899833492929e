#include <cstddef>

#include "smartsurf/view/gl/Layers.h"

namespace smartsurf::view {
namespace {

void attribute(GLuint location, GLint size, GLenum type, std::size_t offset) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, type, type == GL_UNSIGNED_BYTE ? GL_TRUE : GL_FALSE, sizeof(Line),
                        reinterpret_cast<const void*>(offset));
  glVertexAttribDivisor(location, 1);
}

}  // namespace

LineLayer::LineLayer() : array_(make_vertex_array()), lines_(make_buffer()) {
  const auto source = line_shaders();
  program_ = link_program("lines", source.vertex, source.fragment);
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ARRAY_BUFFER, lines_.id());
  attribute(0, 3, GL_FLOAT, offsetof(Line, from));
  attribute(1, 3, GL_FLOAT, offsetof(Line, to));
  attribute(2, 4, GL_UNSIGNED_BYTE, offsetof(Line, colour));
  glBindVertexArray(0);
}

void LineLayer::upload(std::span<const Line> lines) {
  count_ = static_cast<GLsizei>(lines.size());
  glBindBuffer(GL_ARRAY_BUFFER, lines_.id());
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(lines.size_bytes()), lines.data(), GL_STREAM_DRAW);
}

void LineLayer::draw(float width, int picture_width, int picture_height) const {
  if (count_ == 0) return;
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glUseProgram(program_.id());
  glUniform3f(glGetUniformLocation(program_.id(), "picture"), static_cast<float>(picture_width),
              static_cast<float>(picture_height), width);
  glBindVertexArray(array_.id());
  glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, count_);
  glDisable(GL_BLEND);
}

}  // namespace smartsurf::view
