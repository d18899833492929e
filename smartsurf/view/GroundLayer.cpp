#include <cmath>

#include "smartsurf/view/Camera.h"
#include "smartsurf/view/Layers.h"

namespace smartsurf::view {

GroundLayer::GroundLayer(const scene::SurfaceSpec& surface, Pass colour_pass)
    : base_(static_cast<float>(ground_height(surface))),
      reach_(static_cast<float>(20.0 * Camera::extent(surface).diagonal().norm())),
      array_(make_vertex_array()),
      corners_(make_buffer()) {
  // A line every 1, 10, 100 … pitches, so that some ten of them run along the table.
  const double cells = std::max(surface.rows, surface.columns);
  const double decade = std::pow(10.0, std::max(0.0, std::round(std::log10(cells / 6.0))));
  spacing_ = static_cast<float>(surface.pitch * decade);
  const auto ground = ground_shaders(colour_pass), backdrop = backdrop_shaders();
  ground_ = link_program("ground", ground.vertex, ground.fragment);
  backdrop_ = link_program("backdrop", backdrop.vertex, backdrop.fragment);
  static constexpr float kCorners[4][2] = {{-1, -1}, {1, -1}, {-1, 1}, {1, 1}};
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ARRAY_BUFFER, corners_.id());
  glBufferData(GL_ARRAY_BUFFER, sizeof(kCorners), kCorners, GL_STATIC_DRAW);
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, 0, nullptr);
  glBindVertexArray(0);
}

void GroundLayer::draw_ground(bool grid) const {
  glUseProgram(ground_.id());
  glUniform1f(glGetUniformLocation(ground_.id(), "base"), base_);
  glUniform1f(glGetUniformLocation(ground_.id(), "reach"), reach_);
  glUniform1f(glGetUniformLocation(ground_.id(), "spacing"), grid ? spacing_ : 0.0f);
  glBindVertexArray(array_.id());
  glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
}

void GroundLayer::draw_backdrop() const {
  glUseProgram(backdrop_.id());
  glBindVertexArray(array_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

}  // namespace smartsurf::view
