#include <algorithm>
#include <cstddef>
#include <iterator>
#include <vector>

#include "smartsurf/view/gl/Layers.h"

namespace smartsurf::view {
namespace {

// Three faces per pin (the top, the side across x and the side across y), four vertices each. The vertex
// shader derives pin, face and corner from gl_VertexID and turns the sides towards the eye.
constexpr GLuint kVerticesPerPin = 16;  // 12 are used; the shader divides by a power of two
constexpr GLuint kPinIndices[] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7, 8, 9, 10, 8, 10, 11};
constexpr std::size_t kIndicesPerPin = std::size(kPinIndices), kIndicesPerFace = 6;
constexpr GLsizei kTexelsPerPin = 3;
static_assert(sizeof(PinInstance) == 16 * kTexelsPerPin);
constexpr GLint kPinTextureUnit = 2;
constexpr double kLevelTolerance = 0.06;  // in pitches; neighbours whose tops differ by less are level

// How far below its neighbour's top a side is drawn, u. Deeper in the gap it is almost black, but shading it
// takes a quarter of the frame time on a software renderer. The outermost ring is drawn in full (kPinVertex):
// otherwise the background would show through its gaps.
float max_side_depth(const scene::SurfaceSpec& s, RenderPass colour_pass) {
  if (colour_pass == RenderPass::kColourFine) return 1e9f;
  const double gap = s.pitch - std::min(s.pin.top_x, s.pin.top_y);
  return static_cast<float>(std::max(0.8 * s.pitch, 5.0 * gap));
}

std::vector<GLuint> make_pin_indices(std::size_t pins) {
  std::vector<GLuint> indices;
  indices.reserve(pins * kIndicesPerPin);
  for (std::size_t pin = 0; pin < pins; ++pin)
    for (const GLuint vertex : kPinIndices)
      indices.push_back(static_cast<GLuint>(pin) * kVerticesPerPin + vertex);
  return indices;
}

void append_face(std::vector<GLuint>& indices, std::size_t pin, std::size_t face) {
  for (std::size_t i = 0; i < kIndicesPerFace; ++i)
    indices.push_back(static_cast<GLuint>(pin) * kVerticesPerPin + kPinIndices[face * kIndicesPerFace + i]);
}

}  // namespace

PinLayer::PinLayer(const scene::SurfaceSpec& s, RenderPass colour_pass)
    : pin_size_{prism_half_edges(s)[0], prism_half_edges(s)[1], static_cast<float>(s.pin.length),
                static_cast<float>(s.pitch)},
      ground_z_(static_cast<float>(s.ground_height())),
      max_side_depth_(max_side_depth(s, colour_pass)),
      level_tolerance_(static_cast<float>(kLevelTolerance * s.pitch)),
      sealed_(s.has_narrow_gaps()),
      hexagonal_(s.has_hexagonal_tops()),
      vertex_array_(make_vertex_array()),
      index_buffer_(make_buffer()),
      pin_buffer_(make_buffer()),
      visible_index_buffer_(make_buffer()),
      pin_texture_(make_texture()) {
  const auto shadow = pin_shaders(RenderPass::kShadow), colour = pin_shaders(colour_pass);
  shadow_ = link_program("pin shadow", shadow.vertex, shadow.fragment);
  colour_ = link_program("pin", colour.vertex, colour.fragment);
  if (colour_pass == RenderPass::kColourFast && sealed_) {
    const auto closed_shadow = pin_shaders(RenderPass::kShadow, true),
               closed_colour = pin_shaders(colour_pass, true);
    closed_shadow_ = link_program("pin shadow, closed", closed_shadow.vertex, closed_shadow.fragment);
    closed_colour_ = link_program("pin, closed", closed_colour.vertex, closed_colour.fragment);
    visible_indices_.reserve(s.cell_count() * kIndicesPerPin);
  }
  const std::vector<GLuint> triangles = make_pin_indices(s.cell_count() * prisms_per_cell(s));
  glBindVertexArray(vertex_array_.id());
  upload_buffer(GL_ELEMENT_ARRAY_BUFFER, index_buffer_, triangles, GL_STATIC_DRAW);
  glBindVertexArray(0);
}

void PinLayer::upload(std::span<const PinInstance> pins) {
  pins_ = pins;
  upload_buffer(GL_TEXTURE_BUFFER, pin_buffer_, pins, GL_STREAM_DRAW);
}

void PinLayer::draw(RenderPass pass) const {
  draw(pass == RenderPass::kShadow ? shadow_ : colour_, index_buffer_.id(),
       static_cast<GLsizei>(pins_.size() * kIndicesPerPin));
}

// A side is visible where the neighbour in front of it is lower. The outermost ring always has its sides, so
// that its gaps show them instead of the background.
void PinLayer::draw_closed_gaps(RenderPass pass, const EyePosition& eye) {
  visible_indices_.clear();
  for (std::size_t i = 0; i < pins_.size(); ++i) {
    const PinInstance& pin = pins_[i];
    const float x = eye.xy.x() - (eye.at_infinity ? 0.0f : pin.position[0]);
    const float y = eye.xy.y() - (eye.at_infinity ? 0.0f : pin.position[1]);
    const bool outermost = pin.colour[3] != 0;
    append_face(visible_indices_, i, 0);
    if (outermost || pin.neighbour[x < 0.0f ? 0 : 1] < pin.height - level_tolerance_)
      append_face(visible_indices_, i, 1);
    if (outermost || pin.neighbour[y < 0.0f ? 2 : 3] < pin.height - level_tolerance_)
      append_face(visible_indices_, i, 2);
  }
  glBindVertexArray(vertex_array_.id());
  upload_buffer(GL_ELEMENT_ARRAY_BUFFER, visible_index_buffer_, visible_indices_, GL_STREAM_DRAW);
  draw(pass == RenderPass::kShadow ? closed_shadow_ : closed_colour_, visible_index_buffer_.id(),
       static_cast<GLsizei>(visible_indices_.size()));
}

void PinLayer::draw(const ShaderProgram& shader, GLuint triangles, GLsizei indices) const {
  const GLuint program = shader.id();
  glUseProgram(program);
  glUniform4fv(glGetUniformLocation(program, "pin"), 1, pin_size_.data());
  glUniform1f(glGetUniformLocation(program, "base"), ground_z_);
  glUniform1f(glGetUniformLocation(program, "sunk"), max_side_depth_);
  glUniform1f(glGetUniformLocation(program, "level"), level_tolerance_);
  glUniform1f(glGetUniformLocation(program, "sealed"), sealed_ ? 1.0f : 0.0f);
  glUniform1f(glGetUniformLocation(program, "hexagonal"), hexagonal_ ? 1.0f : 0.0f);
  glUniform1i(glGetUniformLocation(program, "pins"), kPinTextureUnit);
  glActiveTexture(GL_TEXTURE0 + kPinTextureUnit);
  glBindTexture(GL_TEXTURE_BUFFER, pin_texture_.id());
  glTexBuffer(GL_TEXTURE_BUFFER, GL_RGBA32UI, pin_buffer_.id());
  glActiveTexture(GL_TEXTURE0);
  glBindVertexArray(vertex_array_.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, triangles);
  glDrawElements(GL_TRIANGLES, indices, GL_UNSIGNED_INT, nullptr);
}

}  // namespace smartsurf::view
