#include <algorithm>
#include <cstddef>

#include "smartsurf/view/gl/Layers.h"
#include "smartsurf/view/model/Meshes.h"

namespace smartsurf::view {
namespace {

using scene::ShapeKind;

void instance_attribute(GLuint location, GLint size, std::size_t offset) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, sizeof(ObjectInstance),
                        reinterpret_cast<const void*>(offset));
  glVertexAttribDivisor(location, 1);
}

void mesh_attribute(GLuint location, GLint size, int floats_a_corner, std::size_t first) {
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, size, GL_FLOAT, GL_FALSE, floats_a_corner * static_cast<int>(sizeof(float)),
                        reinterpret_cast<const void*>(first * sizeof(float)));
}

void load(GLuint buffer, const std::vector<float>& floats) {
  glBindBuffer(GL_ARRAY_BUFFER, buffer);
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(floats.size() * sizeof(float)), floats.data(),
               GL_STATIC_DRAW);
}

// OpenGL 3.3 has no first instance in its draw calls: the attributes begin there instead.
void bind_instances(GLuint buffer, GLsizei first = 0) {
  const std::size_t start = static_cast<std::size_t>(first) * sizeof(ObjectInstance);
  glBindBuffer(GL_ARRAY_BUFFER, buffer);
  instance_attribute(1, 3, start + offsetof(ObjectInstance, centre));
  instance_attribute(2, 3, start + offsetof(ObjectInstance, half_extent));
  instance_attribute(3, 4, start + offsetof(ObjectInstance, orientation));
  instance_attribute(4, 4, start + offsetof(ObjectInstance, colour));
}

// The octagon around a circle of radius 1, x and y of each corner: fewer pixels beside the circle than a
// square.
std::vector<float> around_disc() {
  constexpr float kSide = 0.41421357f;  // half of it: tan(π/8)
  return {kSide, -1, 1, -kSide, 1, kSide, kSide, 1, -kSide, 1, -1, kSide, -1, -kSide, -kSide, -1};
}

}  // namespace

ObjectLayer::ObjectLayer(Pass colour_pass) {
  const int segments = colour_pass == Pass::kColourFine ? 64 : colour_pass == Pass::kColourFast ? 16 : 24;
  sphere_.link("sphere", sphere_shaders(Pass::kShadow), sphere_shaders(colour_pass), wire_shaders(false));
  mesh_.link("mesh", mesh_shaders(Pass::kShadow, false), mesh_shaders(colour_pass, false),
             wire_shaders(false));
  capsule_.link("capsule", mesh_shaders(Pass::kShadow, true), mesh_shaders(colour_pass, true),
                wire_shaders(true));
  const auto make = [this](ShapeKind shape, const Programs& programs, const Mesh& mesh,
                           const std::vector<float>& wire) {
    set_up(kinds_[static_cast<std::size_t>(shape)], programs, 6, mesh.corners, mesh.triangles, wire);
  };
  set_up(kinds_[0], sphere_, 2, around_disc(), {0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5, 0, 5, 6, 0, 6, 7},
         sphere_wire());
  make(ShapeKind::kBox, mesh_, box_mesh(), box_wire());
  make(ShapeKind::kCylinder, mesh_, cylinder_mesh(segments), cylinder_wire());
  make(ShapeKind::kCapsule, capsule_, capsule_mesh(segments), capsule_wire());
  make(ShapeKind::kCone, mesh_, cone_mesh(segments), cone_wire());
}

void ObjectLayer::Programs::link(const char* name, const ShaderSources& shadow_source,
                                 const ShaderSources& colour_source, const ShaderSources& wire_source) {
  shadow = link_program(std::string(name) + " shadow", shadow_source.vertex, shadow_source.fragment);
  colour = link_program(name, colour_source.vertex, colour_source.fragment);
  wires = link_program(std::string(name) + " wires", wire_source.vertex, wire_source.fragment);
}

void ObjectLayer::set_up(Kind& kind, const Programs& programs, int floats_a_corner,
                         const std::vector<float>& mesh, const std::vector<std::uint32_t>& triangles,
                         const std::vector<float>& wire) {
  kind.programs = &programs;
  kind.array = make_vertex_array();
  kind.wire_array = make_vertex_array();
  kind.mesh = make_buffer();
  kind.wire = make_buffer();
  kind.instances = make_buffer();
  kind.triangles = make_buffer();
  kind.indices = static_cast<GLsizei>(triangles.size());
  kind.wire_vertices = static_cast<GLsizei>(wire.size()) / 3;
  glBindVertexArray(kind.array.id());
  load(kind.mesh.id(), mesh);
  mesh_attribute(0, floats_a_corner == 2 ? 2 : 3, floats_a_corner, 0);
  if (floats_a_corner == 6) mesh_attribute(5, 3, floats_a_corner, 3);
  glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, kind.triangles.id());
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.size() * sizeof(std::uint32_t)),
               triangles.data(), GL_STATIC_DRAW);
  bind_instances(kind.instances.id());
  glBindVertexArray(kind.wire_array.id());
  load(kind.wire.id(), wire);
  mesh_attribute(0, 3, 3, 0);
  bind_instances(kind.instances.id());
  glBindVertexArray(0);
}

void ObjectLayer::begin() {
  for (Kind& kind : kinds_) kind.list.clear();
  for (auto& [solid, kind] : solids_) kind.list.clear();
}

void ObjectLayer::add(const scene::ObjectSpec& object, ObjectInstance instance) {
  if (object.shape != ShapeKind::kSolid) {
    kinds_[static_cast<std::size_t>(object.shape)].list.push_back(instance);
    return;
  }
  if (!object.solid) return;
  auto known =
      std::find_if(solids_.begin(), solids_.end(), [&](const auto& s) { return s.first == object.solid; });
  if (known == solids_.end()) {
    known = solids_.insert(known, {object.solid, Kind{}});
    const Mesh mesh = solid_mesh(*object.solid);
    set_up(known->second, mesh_, 6, mesh.corners, mesh.triangles, solid_wire(*object.solid));
  }
  instance.half_extent = {1.0f, 1.0f, 1.0f};  // it has its own size
  known->second.list.push_back(instance);
}

void ObjectLayer::add_box(const ObjectInstance& instance) {
  kinds_[static_cast<std::size_t>(ShapeKind::kBox)].list.push_back(instance);
}

void ObjectLayer::upload() {
  const auto send = [](Kind& kind) {
    kind.count = static_cast<GLsizei>(kind.list.size());
    if (kind.count == 0) return;
    glBindBuffer(GL_ARRAY_BUFFER, kind.instances.id());
    glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(kind.list.size() * sizeof(ObjectInstance)),
                 kind.list.data(), GL_STREAM_DRAW);
  };
  for (Kind& kind : kinds_) send(kind);
  for (auto& [solid, kind] : solids_) send(kind);
}

template <class Action>
void ObjectLayer::for_each_kind(Action action) const {
  for (const Kind& kind : kinds_) action(kind);
  for (const auto& [solid, kind] : solids_) action(kind);
}

void ObjectLayer::draw(Pass pass) const {
  for_each_kind([pass](const Kind& kind) {
    if (kind.count == 0) return;
    glUseProgram(pass == Pass::kShadow ? kind.programs->shadow.id() : kind.programs->colour.id());
    glBindVertexArray(kind.array.id());
    glDrawElementsInstanced(GL_TRIANGLES, kind.indices, GL_UNSIGNED_INT, nullptr, kind.count);
  });
}

void ObjectLayer::draw_solid_boxes(Pass pass, GLsizei solid_boxes) const {
  const Kind& boxes = kinds_[static_cast<std::size_t>(ShapeKind::kBox)];
  glUseProgram(pass == Pass::kShadow ? boxes.programs->shadow.id() : boxes.programs->colour.id());
  glBindVertexArray(boxes.array.id());
  glDrawElementsInstanced(GL_TRIANGLES, boxes.indices, GL_UNSIGNED_INT, nullptr, solid_boxes);
}

void ObjectLayer::draw_wires(float line_width, GLsizei solid_boxes) const {
  std::array<GLfloat, 2> widths{1.0f, 1.0f};
  glGetFloatv(GL_ALIASED_LINE_WIDTH_RANGE, widths.data());
  glLineWidth(std::min(line_width, widths[1]));
  for_each_kind([&](const Kind& kind) {
    const GLsizei first = &kind == &kinds_[static_cast<std::size_t>(ShapeKind::kBox)] ? solid_boxes : 0;
    if (kind.count <= first) return;
    glUseProgram(kind.programs->wires.id());
    glBindVertexArray(kind.wire_array.id());
    bind_instances(kind.instances.id(), first);
    glDrawArraysInstanced(GL_LINES, 0, kind.wire_vertices, kind.count - first);
  });
  glLineWidth(1.0f);
}

}  // namespace smartsurf::view
