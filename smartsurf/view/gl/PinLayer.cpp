#include <algorithm>
#include <cstddef>
#include <iterator>
#include <vector>

#include "smartsurf/view/gl/Layers.h"

namespace smartsurf::view {
namespace {

// Of each pin the top, the side across x and the side across y, four corners each; the shader knows which
// corner is which by its number, and turns the sides towards the eye.
constexpr GLuint kCornersAPin = 16;  // of which 12 are used: a power of two is quickly divided by
constexpr GLuint kTriangles[] = {0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7, 8, 9, 10, 8, 10, 11};
constexpr std::size_t kIndicesAPin = std::size(kTriangles), kIndicesAFace = 6;
constexpr GLsizei kTexelsAPin = 3;
static_assert(sizeof(PinInstance) == 16 * kTexelsAPin);
constexpr GLint kPinUnit = 2;    // of the textures
constexpr double kLevel = 0.06;  // of a pitch: neighbours whose tops differ by less are level

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

void add_face(std::vector<GLuint>& all, std::size_t pin, std::size_t face) {
  for (std::size_t i = 0; i < kIndicesAFace; ++i)
    all.push_back(static_cast<GLuint>(pin) * kCornersAPin + kTriangles[face * kIndicesAFace + i]);
}

}  // namespace

PinLayer::PinLayer(const scene::SurfaceSpec& s, Pass colour_pass)
    : pin_{static_cast<float>(s.pin.top_x / 2.0), static_cast<float>(s.pin.top_y / 2.0),
           static_cast<float>(s.pin.length), static_cast<float>(s.pitch)},
      base_(static_cast<float>(ground_height(s))),
      sunk_(sunk_sides(s, colour_pass)),
      level_(static_cast<float>(kLevel * s.pitch)),
      array_(make_vertex_array()),
      triangles_(make_buffer()),
      records_(make_buffer()),
      seen_triangles_(make_buffer()),
      texture_(make_texture()) {
  const auto shadow = pin_shaders(Pass::kShadow), colour = pin_shaders(colour_pass);
  shadow_ = link_program("pin shadow", shadow.vertex, shadow.fragment);
  colour_ = link_program("pin", colour.vertex, colour.fragment);
  if (colour_pass == Pass::kColourFast && s.cell_poses.empty()) {
    const auto closed_shadow = pin_shaders(Pass::kShadow, true),
               closed_colour = pin_shaders(colour_pass, true);
    closed_shadow_ = link_program("pin shadow, closed", closed_shadow.vertex, closed_shadow.fragment);
    closed_colour_ = link_program("pin, closed", closed_colour.vertex, closed_colour.fragment);
    seen_.reserve(static_cast<std::size_t>(s.cell_count()) * kIndicesAPin);
  }
  const std::vector<GLuint> triangles = triangles_of(static_cast<std::size_t>(s.cell_count()));
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, triangles_.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.size() * sizeof(GLuint)),
               triangles.data(), GL_STATIC_DRAW);
  glBindVertexArray(0);
}

void PinLayer::upload(std::span<const PinInstance> pins) {
  pins_ = pins;
  glBindBuffer(GL_TEXTURE_BUFFER, records_.id());
  glBufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(pins.size_bytes()), pins.data(), GL_STREAM_DRAW);
}

void PinLayer::draw(Pass pass) const {
  draw(pass == Pass::kShadow ? shadow_ : colour_, triangles_.id(),
       static_cast<GLsizei>(pins_.size() * kIndicesAPin));
}

// A side is seen where the neighbour before it is lower; those of the outermost ring are there for what shows
// between them.
void PinLayer::draw_closed(Pass pass, const Sight& sight) {
  seen_.clear();
  for (std::size_t i = 0; i < pins_.size(); ++i) {
    const PinInstance& pin = pins_[i];
    const float x = sight.from.x() - (sight.parallel ? 0.0f : pin.place[0]);
    const float y = sight.from.y() - (sight.parallel ? 0.0f : pin.place[1]);
    const bool outermost = pin.colour[3] != 0;
    add_face(seen_, i, 0);
    if (outermost || pin.neighbour[x < 0.0f ? 0 : 1] < pin.height - level_) add_face(seen_, i, 1);
    if (outermost || pin.neighbour[y < 0.0f ? 2 : 3] < pin.height - level_) add_face(seen_, i, 2);
  }
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, seen_triangles_.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(seen_.size() * sizeof(GLuint)), seen_.data(),
               GL_STREAM_DRAW);
  draw(pass == Pass::kShadow ? closed_shadow_ : closed_colour_, seen_triangles_.id(),
       static_cast<GLsizei>(seen_.size()));
}

void PinLayer::draw(const ShaderProgram& shader, GLuint triangles, GLsizei indices) const {
  const GLuint program = shader.id();
  glUseProgram(program);
  glUniform4fv(glGetUniformLocation(program, "pin"), 1, pin_.data());
  glUniform1f(glGetUniformLocation(program, "base"), base_);
  glUniform1f(glGetUniformLocation(program, "sunk"), sunk_);
  glUniform1f(glGetUniformLocation(program, "level"), level_);
  glUniform1i(glGetUniformLocation(program, "pins"), kPinUnit);
  glActiveTexture(GL_TEXTURE0 + kPinUnit);
  glBindTexture(GL_TEXTURE_BUFFER, texture_.id());
  glTexBuffer(GL_TEXTURE_BUFFER, GL_RGBA32UI, records_.id());
  glActiveTexture(GL_TEXTURE0);
  glBindVertexArray(array_.id());
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, triangles);
  glDrawElements(GL_TRIANGLES, indices, GL_UNSIGNED_INT, nullptr);
}

}  // namespace smartsurf::view
