#include <cstddef>

#include "smartsurf/view/gl/Layers.h"

namespace smartsurf::view {
LineLayer::LineLayer() : vertex_array_(make_vertex_array()), instance_buffer_(make_buffer()) {
  const auto source = line_shaders();
  program_ = link_program("lines", source.vertex, source.fragment);
  glBindVertexArray(vertex_array_.id());
  glBindBuffer(GL_ARRAY_BUFFER, instance_buffer_.id());
  set_instance_attribute<Line>(0, 3, GL_FLOAT, offsetof(Line, from));
  set_instance_attribute<Line>(1, 3, GL_FLOAT, offsetof(Line, to));
  set_instance_attribute<Line>(2, 4, GL_UNSIGNED_BYTE, offsetof(Line, colour));
  glBindVertexArray(0);
}

void LineLayer::upload(std::span<const Line> lines) {
  line_count_ = static_cast<GLsizei>(lines.size());
  upload_buffer(GL_ARRAY_BUFFER, instance_buffer_, lines, GL_STREAM_DRAW);
}

void LineLayer::draw(float width, int viewport_width, int viewport_height) const {
  if (line_count_ == 0) return;
  glEnable(GL_BLEND);
  blend_over();
  glUseProgram(program_.id());
  const auto draw_pass = [&](float pass_width, float is_halo, float opacity) {
    glUniform3f(glGetUniformLocation(program_.id(), "picture"), static_cast<float>(viewport_width),
                static_cast<float>(viewport_height), pass_width);
    glUniform2f(glGetUniformLocation(program_.id(), "style"), is_halo, opacity);
    glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, line_count_);
  };
  glBindVertexArray(vertex_array_.id());
  glDepthMask(GL_FALSE);
  glDepthFunc(GL_GREATER);
  draw_pass(width, 0.0f, 0.3f);
  glDepthFunc(GL_LESS);
  draw_pass(2.0f * width, 1.0f, 0.7f);
  draw_pass(width, 0.0f, 1.0f);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

}  // namespace smartsurf::view
