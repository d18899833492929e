#include <algorithm>
#include <cstddef>
#include <iterator>
#include <vector>

#include "smartsurf/view/Layers.h"
#include "smartsurf/view/ShadowMap.h"

namespace smartsurf::view {
namespace {

// Of each pin the top, the side across x and the side across y, four corners each; the shader knows which
// corner is which by its number, and turns the sides towards the eye.
constexpr GLuint kCornersAPin = 16;  // of which 12 are used: a power of two is quickly divided by
constexpr GLuint kTriangles[] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7, 8, 9, 10, 8, 10, 11};
constexpr std::size_t kIndicesAPin = std::size(kTriangles);
constexpr GLsizei kTexelsAPin = 3;
static_assert(sizeof(PinInstance) == 16 * kTexelsAPin);
constexpr GLint kPinUnit = 2;  // of the textures

// Deep in the gap beside a neighbour a side is as good as black, but costs as much as one in the light:
// without a graphics card a quarter of a frame. There it ends where the gap is dark. Not so in the outermost
// ring, through whose gaps one would look out.
float sunk_sides(const scene::SurfaceSpec& s, Pass colour_pass) {
  if (colour_pass == Pass::kColourFine) return 1e9f;
  const double gap = s.pitch - std::min(s.pin.top_x, s.pin.top_y);
  return static_cast<float>(std::max(0.8 * s.pitch, 5.0 * gap));
}

std::vector<GLuint> triangles_of(std::size_t pins) {
  std::vector<GLuint> all;
  all.reserve(pins * kIndicesAPin);
  for (std::size_t pin = 0; pin < pins; ++pin)
    for (const GLuint corner : kTriangles) all.push_back(static_cast<GLuint>(pin) * kCornersAPin + corner);
  return all;
}

}  // namespace

PinLayer::PinLayer(const scene::SurfaceSpec& s, Pass colour_pass)
    : pin_{static_cast<float>(s.pin.top_x / 2.0), static_cast<float>(s.pin.top_y / 2.0),
           static_cast<float>(s.pin.length), static_cast<float>(s.pitch)},
      base_(static_cast<float>(ground_height(s))),
      sunk_(sunk_sides(s, colour_pass)),
      free_layout_(!s.places.empty()),
      array_(make_vertex_array()),
      shadow_array_(make_vertex_array()),
      triangles_(make_buffer()),
      shadow_triangles_(make_buffer()),
      records_(make_buffer()),
      texture_(make_texture()) {
  const auto shadow = pin_shaders(Pass::kShadow), colour = pin_shaders(colour_pass);
  shadow_ = link_program("pin shadow", shadow.vertex, shadow.fragment);
  colour_ = link_program("pin", colour.vertex, colour.fragment);
  const std::vector<GLuint> triangles = triangles_of(static_cast<std::size_t>(s.cells()));
  glBindVertexArray(shadow_array_.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, shadow_triangles_.id());
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, triangles_.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.size() * sizeof(GLuint)),
               triangles.data(), GL_STATIC_DRAW);
  glBindVertexArray(0);
}

// A side that a neighbour hides from the sun throws no shadow: the light would have to come through that
// neighbour's top, or through a side that is in the list. In a free layout neighbours by number need not be
// beside each other.
void PinLayer::upload_shadows(std::span<const PinInstance> pins) {
  const Eigen::Vector3d sun = ShadowMap::towards_light();
  const int beside_x = sun.x() < 0.0 ? 0 : 1, beside_y = sun.y() < 0.0 ? 2 : 3;  // of PinInstance::neighbour
  std::size_t used = 0;
  shadow_list_.resize(pins.size() * kIndicesAPin);
  const auto add_face = [&](std::size_t pin, std::size_t face) {
    for (std::size_t i = 6 * face; i < 6 * face + 6; ++i)
      shadow_list_[used++] = static_cast<GLuint>(pin) * kCornersAPin + kTriangles[i];
  };
  for (std::size_t pin = 0; pin < pins.size(); ++pin) {
    const PinInstance& p = pins[pin];
    add_face(pin, 0);
    if (free_layout_ || p.neighbour[beside_x] < p.height) add_face(pin, 1);
    if (free_layout_ || p.neighbour[beside_y] < p.height) add_face(pin, 2);
  }
  shadow_indices_ = static_cast<GLsizei>(used);
  glBindVertexArray(shadow_array_.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(used * sizeof(GLuint)), shadow_list_.data(),
               GL_STREAM_DRAW);
  glBindVertexArray(0);
}

void PinLayer::upload(std::span<const PinInstance> pins, bool shadows) {
  if (shadows) upload_shadows(pins);
  count_ = static_cast<GLsizei>(pins.size());
  glBindBuffer(GL_TEXTURE_BUFFER, records_.id());
  glBufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(pins.size_bytes()), pins.data(), GL_STREAM_DRAW);
}

void PinLayer::draw(Pass pass) const {
  const GLuint program = pass == Pass::kShadow ? shadow_.id() : colour_.id();
  glUseProgram(program);
  glUniform4fv(glGetUniformLocation(program, "pin"), 1, pin_.data());
  glUniform1f(glGetUniformLocation(program, "base"), base_);
  glUniform1f(glGetUniformLocation(program, "sunk"), sunk_);
  glUniform1i(glGetUniformLocation(program, "pins"), kPinUnit);
  glActiveTexture(GL_TEXTURE0 + kPinUnit);
  glBindTexture(GL_TEXTURE_BUFFER, texture_.id());
  glTexBuffer(GL_TEXTURE_BUFFER, GL_RGBA32UI, records_.id());
  glActiveTexture(GL_TEXTURE0);
  const bool shadows = pass == Pass::kShadow;
  glBindVertexArray(shadows ? shadow_array_.id() : array_.id());
  glDrawElements(GL_TRIANGLES, shadows ? shadow_indices_ : count_ * static_cast<GLsizei>(kIndicesAPin),
                 GL_UNSIGNED_INT, nullptr);
}

}  // namespace smartsurf::view
