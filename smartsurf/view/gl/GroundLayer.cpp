#include <algorithm>
#include <cmath>
#include <cstddef>

#include "smartsurf/view/gl/Layers.h"
#include "smartsurf/view/model/Camera.h"

namespace smartsurf::view {
namespace {

// The part beside the table, and four around it.
constexpr float kCorners[8][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {-2, -2}, {2, -2}, {2, 2}, {-2, 2}};
constexpr GLubyte kTriangles[] = {0, 1, 2, 0, 2, 3, 4, 5, 1, 4, 1, 0, 5, 6, 2,
                                  5, 2, 1, 6, 7, 3, 6, 3, 2, 7, 4, 0, 7, 0, 3};
constexpr int kNear = 6, kFar = 24;  // of them
constexpr double kDim = 6.0;         // u, as in the ground's shader

}  // namespace

GroundLayer::GroundLayer(const scene::SurfaceSpec& surface, Pass colour_pass)
    : dim_(Camera::extent(surface).min().head<2>().array() - kDim,
           Camera::extent(surface).max().head<2>().array() + kDim),
      base_(static_cast<float>(ground_height(surface))),
      reach_(static_cast<float>(20.0 * Camera::extent(surface).diagonal().norm())),
      array_(make_vertex_array()),
      corners_(make_buffer()),
      triangles_(make_buffer()) {
  // A line every 1, 10, 100 … pitches, so that some ten of them run along the table.
  const double cells = std::max(surface.rows, surface.columns);
  const double decade = std::pow(10.0, std::max(0.0, std::round(std::log10(cells / 6.0))));
  spacing_ = static_cast<float>(surface.pitch * decade);
  const auto shaded = ground_shaders(colour_pass, true), backdrop = backdrop_shaders();
  shaded_ = link_program("ground", shaded.vertex, shaded.fragment);
  backdrop_ = link_program("backdrop", backdrop.vertex, backdrop.fragment);
  if (colour_pass == Pass::kColourFast) {
    const auto sunlit = ground_shaders(colour_pass, false);
    sunlit_ = link_program("sunlit ground", sunlit.vertex, sunlit.fragment);
  }
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ARRAY_BUFFER, corners_.id());
  glBufferData(GL_ARRAY_BUFFER, sizeof(kCorners), kCorners, GL_STATIC_DRAW);
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, 0, nullptr);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, triangles_.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, sizeof(kTriangles), kTriangles, GL_STATIC_DRAW);
  glBindVertexArray(0);
}

void GroundLayer::draw_section(const ShaderProgram& program, bool grid, const Eigen::AlignedBox2d& shaded,
                               int first, int count) const {
  glUseProgram(program.id());
  glUniform1f(glGetUniformLocation(program.id(), "base"), base_);
  glUniform1f(glGetUniformLocation(program.id(), "reach"), reach_);
  const Eigen::Vector4f edges = (Eigen::Vector4d() << shaded.min(), shaded.max()).finished().cast<float>();
  glUniform4fv(glGetUniformLocation(program.id(), "shaded"), 1, edges.data());
  glUniform1f(glGetUniformLocation(program.id(), "spacing"), grid ? spacing_ : 0.0f);
  glBindVertexArray(array_.id());
  glDrawElements(GL_TRIANGLES, count, GL_UNSIGNED_BYTE, reinterpret_cast<const void*>(std::ptrdiff_t{first}));
}

void GroundLayer::draw_ground(bool grid, const Eigen::AlignedBox2d& shade) const {
  const Eigen::AlignedBox2d shaded = dim_.merged(shade);
  if (sunlit_.id() == 0) return draw_section(shaded_, grid, shaded, 0, kNear + kFar);
  draw_section(shaded_, grid, shaded, 0, kNear);
  draw_section(sunlit_, grid, shaded, kNear, kFar);
}

void GroundLayer::draw_backdrop() const {
  glUseProgram(backdrop_.id());
  glBindVertexArray(array_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

}  // namespace smartsurf::view
