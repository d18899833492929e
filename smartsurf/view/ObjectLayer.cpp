#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "smartsurf/view/Layers.h"

namespace smartsurf::view {
namespace {

using scene::ShapeKind;

std::array<float, 2> on_circle(int step, int steps) {
  const double angle = 2.0 * std::numbers::pi * step / steps;
  return {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
}

struct Mesh {
  std::vector<float> floats;
  std::vector<GLushort> triangles;
  void corner(float x, float y, float z) { floats.insert(floats.end(), {x, y, z}); }
  GLushort corner(float x, float y, float z, float nx, float ny, float nz) {
    floats.insert(floats.end(), {x, y, z, nx, ny, nz});
    return static_cast<GLushort>(floats.size() / 6 - 1);
  }
  void triangle(int a, int b, int c) {
    for (int corner : {a, b, c}) triangles.push_back(static_cast<GLushort>(corner));
  }
};

Mesh quad_mesh() { return {{-1, -1, 1, -1, 1, 1, -1, 1}, {0, 1, 2, 0, 2, 3}}; }

// All meshes fill the cube from −1 to 1; the instance's half extents scale them.
Mesh box_mesh() {
  Mesh mesh;
  static constexpr float kQuad[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  for (int axis = 0; axis < 3; ++axis)
    for (float side : {-1.0f, 1.0f}) {
      const int first = static_cast<int>(mesh.floats.size() / 6);
      for (const auto& q : kQuad) {
        std::array<float, 3> p{}, n{};
        p[axis] = n[axis] = side;
        p[(axis + 1) % 3] = q[0];
        p[(axis + 2) % 3] = q[1];
        mesh.corner(p[0], p[1], p[2], n[0], n[1], n[2]);
      }
      mesh.triangle(first, first + 1, first + 2);
      mesh.triangle(first, first + 2, first + 3);
    }
  return mesh;
}

Mesh cylinder_mesh(int segments) {
  Mesh mesh;
  for (int i = 0; i < segments; ++i) {
    const auto [x, y] = on_circle(i, segments);
    const int low = mesh.corner(x, y, -1, x, y, 0), next = (low + 4) % (4 * segments);
    mesh.corner(x, y, 1, x, y, 0);
    mesh.corner(x, y, -1, 0, 0, -1);
    mesh.corner(x, y, 1, 0, 0, 1);
    mesh.triangle(low, next, next + 1);
    mesh.triangle(low, next + 1, low + 1);
    if (i == 0 || i + 1 == segments) continue;
    mesh.triangle(2, low + 2, next + 2);  // the caps are fans around the first corner
    mesh.triangle(3, low + 3, next + 3);
  }
  return mesh;
}

void add_ring(Mesh& mesh, float radius, float z, int steps) {
  for (int i = 0; i < steps; ++i)
    for (int end = 0; end < 2; ++end) {
      const auto [x, y] = on_circle(i + end, steps);
      mesh.corner(radius * x, radius * y, z);
    }
}

std::vector<float> sphere_wire() {
  Mesh mesh;
  constexpr int kMeridians = 12, kParallels = 7, kSteps = 36;
  for (int p = 1; p <= kParallels; ++p) {
    const double angle = std::numbers::pi * (static_cast<double>(p) / (kParallels + 1) - 0.5);
    add_ring(mesh, static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), kSteps);
  }
  for (int m = 0; m < kMeridians; ++m) {
    const auto [mx, my] = on_circle(m, kMeridians);
    for (int i = 0; i < kSteps / 2; ++i)
      for (int end = 0; end < 2; ++end) {
        const auto [z, r] = on_circle(i + end, kSteps);
        mesh.corner(r * mx, r * my, z);
      }
  }
  return mesh.floats;
}

std::vector<float> box_wire() {
  Mesh mesh;
  for (int axis = 0; axis < 3; ++axis)
    for (float a : {-1.0f, 1.0f})
      for (float b : {-1.0f, 1.0f})
        for (float along : {-1.0f, 1.0f}) {
          std::array<float, 3> p{};
          p[axis] = along;
          p[(axis + 1) % 3] = a;
          p[(axis + 2) % 3] = b;
          mesh.corner(p[0], p[1], p[2]);
        }
  return mesh.floats;
}

std::vector<float> cylinder_wire() {
  Mesh mesh;
  for (float z : {-1.0f, 0.0f, 1.0f}) add_ring(mesh, 1.0f, z, 36);
  for (int i = 0; i < 12; ++i) {
    const auto [x, y] = on_circle(i, 12);
    mesh.corner(x, y, -1);
    mesh.corner(x, y, 1);
  }
  return mesh.floats;
}

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

}  // namespace

ObjectLayer::ObjectLayer(Pass colour_pass) {
  for (const ShapeKind shape : {ShapeKind::kSphere, ShapeKind::kBox, ShapeKind::kCylinder}) {
    const bool ball = shape == ShapeKind::kSphere;
    Kind& kind = kinds_[static_cast<std::size_t>(shape)];
    const auto shadow = ball ? sphere_shaders(Pass::kShadow) : mesh_shaders(Pass::kShadow);
    const auto colour = ball ? sphere_shaders(colour_pass) : mesh_shaders(colour_pass);
    kind.shadow = link_program(ball ? "sphere shadow" : "mesh shadow", shadow.vertex, shadow.fragment);
    kind.colour = link_program(ball ? "sphere" : "mesh", colour.vertex, colour.fragment);
  }
  const Mesh quad = quad_mesh(), box = box_mesh(),
             cylinder = cylinder_mesh(colour_pass == Pass::kColourFine ? 64 : 24);
  set_up(kinds_[0], 2, quad.floats, quad.triangles, sphere_wire());
  set_up(kinds_[1], 6, box.floats, box.triangles, box_wire());
  set_up(kinds_[2], 6, cylinder.floats, cylinder.triangles, cylinder_wire());
  const auto wires = wire_shaders();
  wires_ = link_program("wires", wires.vertex, wires.fragment);
}

void ObjectLayer::set_up(Kind& kind, int floats_a_corner, const std::vector<float>& mesh,
                         const std::vector<GLushort>& triangles, const std::vector<float>& wire) {
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
  glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.size() * sizeof(GLushort)),
               triangles.data(), GL_STATIC_DRAW);
  bind_instances(kind.instances.id());
  glBindVertexArray(kind.wire_array.id());
  load(kind.wire.id(), wire);
  mesh_attribute(0, 3, 3, 0);
  bind_instances(kind.instances.id());
  glBindVertexArray(0);
}

void ObjectLayer::upload(ShapeKind shape, std::span<const ObjectInstance> instances) {
  Kind& kind = kinds_[static_cast<std::size_t>(shape)];
  kind.count = static_cast<GLsizei>(instances.size());
  glBindBuffer(GL_ARRAY_BUFFER, kind.instances.id());
  glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(instances.size_bytes()), instances.data(),
               GL_STREAM_DRAW);
}

void ObjectLayer::draw(Pass pass) const {
  for (const Kind& kind : kinds_) {
    if (kind.count == 0) continue;
    glUseProgram(pass == Pass::kShadow ? kind.shadow.id() : kind.colour.id());
    glBindVertexArray(kind.array.id());
    glDrawElementsInstanced(GL_TRIANGLES, kind.indices, GL_UNSIGNED_SHORT, nullptr, kind.count);
  }
}

void ObjectLayer::draw_solid_boxes(Pass pass, GLsizei solid_boxes) const {
  const Kind& boxes = kinds_[static_cast<std::size_t>(ShapeKind::kBox)];
  glUseProgram(pass == Pass::kShadow ? boxes.shadow.id() : boxes.colour.id());
  glBindVertexArray(boxes.array.id());
  glDrawElementsInstanced(GL_TRIANGLES, boxes.indices, GL_UNSIGNED_SHORT, nullptr, solid_boxes);
}

void ObjectLayer::draw_wires(float line_width, GLsizei solid_boxes) const {
  std::array<GLfloat, 2> widths{1.0f, 1.0f};
  glGetFloatv(GL_ALIASED_LINE_WIDTH_RANGE, widths.data());
  glLineWidth(std::min(line_width, widths[1]));
  glUseProgram(wires_.id());
  for (const Kind& kind : kinds_) {
    const GLsizei first = &kind == &kinds_[static_cast<std::size_t>(ShapeKind::kBox)] ? solid_boxes : 0;
    if (kind.count <= first) continue;
    glBindVertexArray(kind.wire_array.id());
    bind_instances(kind.instances.id(), first);
    glDrawArraysInstanced(GL_LINES, 0, kind.wire_vertices, kind.count - first);
  }
  glLineWidth(1.0f);
}

}  // namespace smartsurf::view
