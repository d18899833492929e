#include <algorithm>
#include <cmath>
#include <cstddef>

#include "smartsurf/view/gl/Layers.h"
#include "smartsurf/view/model/StageModel.h"
#include "smartsurf/view/model/TableBounds.h"

namespace smartsurf::view {
namespace {

// An inner rectangle (±1) and four quads between it and the outer edge (±2); see kGroundVertex.
constexpr float kGroundVertices[8][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1},
                                         {-2, -2}, {2, -2}, {2, 2}, {-2, 2}};
constexpr GLubyte kGroundIndices[] = {0, 1, 2, 0, 2, 3, 4, 5, 1, 4, 1, 0, 5, 6, 2,
                                      5, 2, 1, 6, 7, 3, 6, 3, 2, 7, 4, 0, 7, 0, 3};
constexpr int kNearIndexCount = 6, kFarIndexCount = 24;  // inner rectangle, outer quads
constexpr double kDarkenedMargin = 6.0;                  // pitches

}  // namespace

GroundLayer::GroundLayer(const scene::SurfaceSpec& surface, RenderPass colour_pass)
    : darkened_(kDarkenedMargin * surface.pitch),
      occluded_area_(surface_bounding_box(surface).min().head<2>().array() - darkened_,
                     surface_bounding_box(surface).max().head<2>().array() + darkened_),
      ground_z_(static_cast<float>(surface.ground_height())),
      half_extent_(static_cast<float>(ground_half_edge(surface))),
      grid_spacing_(static_cast<float>(grid_spacing(surface))),
      vertex_array_(make_vertex_array()),
      vertex_buffer_(make_buffer()),
      index_buffer_(make_buffer()) {
  const auto shadowed = ground_shaders(colour_pass, true), backdrop = backdrop_shaders();
  shadowed_program_ = link_program("ground", shadowed.vertex, shadowed.fragment);
  backdrop_program_ = link_program("backdrop", backdrop.vertex, backdrop.fragment);
  if (colour_pass == RenderPass::kColourFast) {
    const auto unshadowed = ground_shaders(colour_pass, false);
    unshadowed_program_ = link_program("unshadowed ground", unshadowed.vertex, unshadowed.fragment);
  }
  glBindVertexArray(vertex_array_.id());
  upload_buffer(GL_ARRAY_BUFFER, vertex_buffer_, kGroundVertices, GL_STATIC_DRAW);
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, 0, nullptr);
  upload_buffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer_, kGroundIndices, GL_STATIC_DRAW);
  glBindVertexArray(0);
}

void GroundLayer::draw_section(const ShaderProgram& program, bool grid,
                               const Eigen::AlignedBox2d& shaded_area, int first, int count) const {
  glUseProgram(program.id());
  glUniform1f(glGetUniformLocation(program.id(), "base"), ground_z_);
  glUniform1f(glGetUniformLocation(program.id(), "reach"), half_extent_);
  const Eigen::Vector4f edges =
      (Eigen::Vector4d() << shaded_area.min(), shaded_area.max()).finished().cast<float>();
  glUniform4fv(glGetUniformLocation(program.id(), "shaded"), 1, edges.data());
  glUniform1f(glGetUniformLocation(program.id(), "spacing"), grid ? grid_spacing_ : 0.0f);
  glUniform1f(glGetUniformLocation(program.id(), "darkened"), static_cast<float>(darkened_));
  glBindVertexArray(vertex_array_.id());
  glDrawElements(GL_TRIANGLES, count, GL_UNSIGNED_BYTE, reinterpret_cast<const void*>(std::ptrdiff_t{first}));
}

void GroundLayer::draw_ground(bool grid, const Eigen::AlignedBox2d& shadow_area) const {
  const Eigen::AlignedBox2d shaded_area = occluded_area_.merged(shadow_area);
  if (unshadowed_program_.id() == 0)
    return draw_section(shadowed_program_, grid, shaded_area, 0, kNearIndexCount + kFarIndexCount);
  draw_section(shadowed_program_, grid, shaded_area, 0, kNearIndexCount);
  draw_section(unshadowed_program_, grid, shaded_area, kNearIndexCount, kFarIndexCount);
}

void GroundLayer::draw_backdrop() const {
  glUseProgram(backdrop_program_.id());
  glBindVertexArray(vertex_array_.id());
  glDrawArrays(GL_TRIANGLES, 0, 3);
}

}  // namespace smartsurf::view
