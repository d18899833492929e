#include <algorithm>
#include <cstddef>

#include "smartsurf/view/Layers.h"

namespace smartsurf::view {
namespace {

// The top, the side across x and the side across y; the shader turns the sides towards the eye.
constexpr float kCorners[12][4] = {{-1, -1, 1, 0}, {1, -1, 1, 0}, {1, 1, 1, 0}, {-1, 1, 1, 0},
                                   {1, -1, 0, 1},  {1, 1, 0, 1},  {1, 1, 1, 1}, {1, -1, 1, 1},
                                   {-1, 1, 0, 2},  {1, 1, 0, 2},  {1, 1, 1, 2}, {-1, 1, 1, 2}};
constexpr GLubyte kTriangles[18] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7, 8, 9, 10, 8, 10, 11};

// Deep in the gap beside a neighbour a side is as good as black, but costs as much as one in the light:
// without a graphics card a quarter of a frame. There it ends where the gap is dark. Not so in the outermost
// ring, through whose gaps one would look out.
float sunk_sides(const scene::SurfaceSpec& s, Pass colour_pass) {
  if (colour_pass == Pass::kColourFine) return 1e9f;
  const double gap = s.pitch - std::min(s.pin.top_x, s.pin.top_y);
  return static_cast<float>(std::max(0.8 * s.pitch, 5.0 * gap));
}

void attribute(GLuint location, GLint size, GLenum type, std::size_t offset) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, type, type == GL_UNSIGNED_BYTE ? GL_TRUE : GL_FALSE,
                        sizeof(PinInstance), reinterpret_cast<const void*>(offset));
  glVertexAttribDivisor(location, 1);
}

}  // namespace

PinLayer::PinLayer(const scene::SurfaceSpec& s, Pass colour_pass)
    : pin_{static_cast<float>(s.pin.top_x / 2.0), static_cast<float>(s.pin.top_y / 2.0),
           static_cast<float>(s.pin.length), static_cast<float>(s.pitch)},
      base_(static_cast<float>(ground_height(s))),
      sunk_(sunk_sides(s, colour_pass)),
      array_(make_vertex_array()),
      corners_(make_buffer()),
      triangles_(make_buffer()),
      instances_(make_buffer()) {
  const auto shadow = pin_shaders(Pass::kShadow), colour = pin_shaders(colour_pass);
  shadow_ = link_program("pin shadow", shadow.vertex, shadow.fragment);
  colour_ = link_program("pin", colour.vertex, colour.fragment);
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ARRAY_BUFFER, corners_.id());
  glBufferData(GL_ARRAY_BUFFER, sizeof(kCorners), kCorners, GL_STATIC_DRAW);
  glEnableVertexAttribArray(0);
  glVertexAttribPointer(0, 4, GL_FLOAT, GL_FALSE, 0, nullptr);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, triangles_.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, sizeof(kTriangles), kTriangles, GL_STATIC_DRAW);
  glBindBuffer(GL_ARRAY_BUFFER, instances_.id());
  attribute(1, 1, GL_FLOAT, offsetof(PinInstance, height));
  attribute(2, 4, GL_UNSIGNED_BYTE, offsetof(PinInstance, colour));
  attribute(3, 4, GL_UNSIGNED_BYTE, offsetof(PinInstance, corner_sky));
  attribute(4, 4, GL_FLOAT, offsetof(PinInstance, neighbour));
  attribute(5, 3, GL_FLOAT, offsetof(PinInstance, place));
  glBindVertexArray(0);
}

void PinLayer::upload(std::span<const PinInstance> pins) {
  count_ = static_cast<GLsizei>(pins.size());
  glBindBuffer(GL_ARRAY_BUFFER, instances_.id());
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(pins.size_bytes()), pins.data(), GL_STREAM_DRAW);
}

void PinLayer::draw(Pass pass) const {
  const GLuint program = pass == Pass::kShadow ? shadow_.id() : colour_.id();
  glUseProgram(program);
  glUniform4fv(glGetUniformLocation(program, "pin"), 1, pin_.data());
  glUniform1f(glGetUniformLocation(program, "base"), base_);
  glUniform1f(glGetUniformLocation(program, "sunk"), sunk_);
  glBindVertexArray(array_.id());
  glDrawElementsInstanced(GL_TRIANGLES, 18, GL_UNSIGNED_BYTE, nullptr, count_);
}

}  // namespace smartsurf::view
